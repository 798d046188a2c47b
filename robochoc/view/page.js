"use strict";
try {
  const viewer = new MeshCat.Viewer(document.getElementById("stage"));
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const paintSky = () => {
    viewer.set_property(["Background"], "top_color", dark.matches ? [0.05, 0.07, 0.1] : [0.8, 0.88, 0.95]);
    viewer.set_property(["Background"], "bottom_color", dark.matches ? [0.12, 0.15, 0.2] : [0.97, 0.97, 0.95]);
  };
  // On a narrow screen the scene must fit the width, not the height.
  const fit = () => { viewer.camera.zoom = Math.min(1, innerWidth / innerHeight); viewer.set_dirty(); };
  dark.addEventListener("change", paintSky);
  addEventListener("resize", fit);
  paintSky();
  fit();
  document.getElementById("again").addEventListener("click", () => { viewer.animator.reset(); viewer.animator.play(); });

  const commands = document.getElementById("commands").textContent.trim();
  if (commands) {
    for (const command of commands.split("\n"))
      viewer.handle_command_bytearray(Uint8Array.from(atob(command), (sign) => sign.charCodeAt(0)));
    if (matchMedia("(prefers-reduced-motion: reduce)").matches) {
      viewer.animator.pause();
      viewer.animator.seek(viewer.animator.duration);
    }
  } else viewer.connect("ws://" + location.host + "/commands");
} catch (error) {
  const trouble = document.getElementById("trouble");
  trouble.append(error.message);
  trouble.hidden = false;
}
