// The page: connects the player, the time line, the camera, trails and labels.
try {
  const THREE = MeshCat.THREE;
  const element = (id) => document.getElementById(id);
  const playback = JSON.parse(element("playback").textContent);
  const viewer = new MeshCat.Viewer(element("scene"), true, Picture.renderer(element("scene")));
  viewer.gui.domElement.remove(); // meshcat's own controls, a row for each object
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const narrow = matchMedia("(max-width: 40rem)");
  // ?driven: a surrounding page has the time line. Then nothing plays by itself, and this page shows no time line.
  const driven = new URLSearchParams(location.search).has("driven");
  viewer.set_property(["Background"], "visible", false); // the page's own sky is faster
  const free = () => {
    const [caption, controls] = [element("caption"), element("controls")].map((one) => one.getBoundingClientRect());
    const bottom = controls.top;
    if (narrow.matches) return { left: 0, top: caption.bottom, right: innerWidth, bottom };
    const beside = Math.max(Math.min(caption.right, innerWidth - bottom), 0);
    return { left: beside, top: 0, right: innerWidth, bottom };
  };
  for (const one of document.querySelectorAll(".playback")) one.hidden = !playback.duration;
  document.documentElement.toggleAttribute("data-driven", driven);
  if (driven) for (const id of ["line", "play", "again", "clock", "speed-label"]) element(id).hidden = true;
  element("facts").open = !narrow.matches && !driven;
  element("controls").hidden = false;
  const object = (path) => viewer.scene_tree.find(["meshcat", ...path.split("/")]).object;
  const player = new Player(playback.duration);
  const timeline = playback.duration ? new Timeline(playback, player) : null;
  const trails = new Trails(viewer);
  const picture = new Picture(viewer);
  const camera = new Camera(viewer, playback.corners, playback.cell, free, still);
  const fit = () => { trails.resize(); camera.fit(); timeline?.spread(); };
  const drones = playback.drones.map((drone) => object(drone.path));
  const swarm = new Swarm(viewer, playback.drones.map((drone) => object(`${drone.path}/body`)));
  const labels = new Labels(viewer, playback.drones.map((drone) => object(`${drone.path}/name`)), object("axes"));

  const frame = (now) => {
    player.step(now);
    camera.step(now);
    swarm.step();
    labels.step(now);
    picture.step(now);
    requestAnimationFrame(frame);
  };

  // Time
  player.ontime = (time) => {
    viewer.animator.seek(time);
    trails.now = time;
    timeline.show(time);
  };
  player.onstate = () => {
    const label = player.playing ? "Pause" : player.ended ? "Play again" : "Play";
    element("play").classList.toggle("playing", player.playing);
    element("play").setAttribute("aria-label", label);
  };
  const setSpeed = (speed) => { player.speed = speed; element("speed").value = String(speed); };
  const setTrail = (wanted) => { element("trail").value = wanted; trails.show(wanted); };
  element("play").addEventListener("click", () => player.toggle());
  element("again").addEventListener("click", () => { player.seek(0); player.play(); });
  element("speed").addEventListener("change", () => setSpeed(Number(element("speed").value)));
  element("trail").addEventListener("change", () => setTrail(element("trail").value));

  // Pictures of labels are postponed. The scene's camera comes with the commands; its distance depends on the window.
  const handle = viewer.handle_command.bind(viewer);
  viewer.handle_command = (command) => {
    labels.postpone(command);
    handle(command);
    if (String(command.path).startsWith("/Cameras")) fit();
  };

  // The playback comes with the commands, at once or over the WebSocket: from then on the player controls its time.
  const load = viewer.animator.load.bind(viewer.animator);
  viewer.animator.load = (animations, options) => {
    load(animations, options);
    viewer.animator.pause();
    const ways = [];
    for (const action of viewer.animator.actions) {
      const number = drones.indexOf(action.getRoot());
      const moves = action.getClip().tracks.find((track) => track.name === ".position");
      if (number >= 0 && moves) ways.push([moves.times, moves.values, playback.drones[number].states, playback.drones[number].colour]);
    }
    trails.draw(ways, viewer.scene_tree.find(["meshcat"]).object);
    setTrail(element("trail").value);
    player.seek(still.matches && !driven ? player.duration : 0);
    if (!still.matches && !driven) player.play(Player.LEAD);
  };

  // Camera
  const views = ["overview", "top", "front"];
  const chosen = element("drone");
  for (const [number, drone] of playback.drones.entries()) {
    const option = document.createElement("option");
    option.value = String(number);
    option.textContent = drone.name;
    chosen.append(option);
  }
  const follow = (number) => {
    chosen.value = String(number);
    camera.follow(drones[number]);
    labels.followed = number;
  };
  camera.onview = (view) => {
    if (view !== "follow") labels.followed = -1;
    for (const name of [...views, "follow"]) element(name).setAttribute("aria-pressed", name === view);
  };
  for (const view of views) element(view).addEventListener("click", () => camera.see(view));
  element("follow").addEventListener("click", () => drones.length && follow(Number(chosen.value)));
  chosen.addEventListener("change", () => follow(Number(chosen.value)));
  element("follow").disabled = chosen.disabled = !drones.length;

  // The drone under the pointer, or the nearest drone within a finger's width.
  const under = (event) => {
    let [found, least] = [-1, event.pointerType === "mouse" ? 20 : 30];
    drones.forEach((drone, number) => {
      const spot = drone.getWorldPosition(new THREE.Vector3()).project(viewer.camera);
      const off = Math.hypot((spot.x + 1) / 2 * innerWidth - event.clientX, (1 - spot.y) / 2 * innerHeight - event.clientY);
      if (spot.z < 1 && off < least) [found, least] = [number, off];
    });
    return found;
  };
  let pressed = null;
  element("scene").addEventListener("pointerdown", (event) => { pressed = [event.clientX, event.clientY]; });
  element("scene").addEventListener("pointermove", (event) => {
    if (!event.buttons) element("scene").classList.toggle("pointed", under(event) >= 0);
  });
  addEventListener("pointerup", (event) => {
    const clicked = pressed && Math.hypot(event.clientX - pressed[0], event.clientY - pressed[1]) < 5;
    pressed = null;
    const number = clicked ? under(event) : -1;
    if (number >= 0) follow(number);
  });

  // Keys
  const keys = {
    1: () => camera.see("overview"),
    2: () => camera.see("top"),
    3: () => camera.see("front"),
    "?": () => { element("keys").open = !element("keys").open; },
    Escape: () => { element("keys").open = false; },
    4: () => drones.length && follow((Number(chosen.value) + (camera.view === "follow" ? 1 : 0)) % drones.length),
  };
  const step = (seconds) => { player.pause(); player.seek(player.time + seconds); };
  const jump = (forth) => player.seek(timeline.beside(player.time, forth));
  const faster = (by) => setSpeed(Player.SPEEDS[
    Math.min(Math.max(Player.SPEEDS.indexOf(player.speed) + by, 0), Player.SPEEDS.length - 1)]);
  const trailed = [...element("trail").options].map((option) => option.value);
  if (timeline)
    Object.assign(keys, {
      " ": () => player.toggle(),
      ArrowLeft: (event) => (event.shiftKey ? jump(false) : step(-0.1)),
      ArrowRight: (event) => (event.shiftKey ? jump(true) : step(0.1)),
      Home: () => player.seek(0),
      End: () => { player.pause(); player.seek(player.duration); },
      "-": () => faster(-1),
      "+": () => faster(1),
      t: () => setTrail(trailed[(trailed.indexOf(element("trail").value) + 1) % trailed.length]),
    });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("select")) return;
    if (event.key === " " && event.target.matches("button, summary")) return; // the key presses the button
    const does = Object.hasOwn(keys, event.key) ? keys[event.key] : keys[event.key.toLowerCase()];
    if (typeof does !== "function" || event.key.length > 1 && !Object.hasOwn(keys, event.key)) return;
    event.preventDefault();
    does(event);
  });

  // After a click the button loses the focus: then space plays, and does not press the button again.
  addEventListener("click", (event) => { if (event.detail) event.target.closest?.("button, summary")?.blur(); });
  addEventListener("click", (event) => { if (!element("keys").contains(event.target)) element("keys").open = false; });

  addEventListener("resize", fit);
  // A long text of an epoch, or the unfolded facts, cover a part of the scene.
  new ResizeObserver(() => { if (narrow.matches) fit(); }).observe(element("caption"));

  const commands = element("commands").textContent.trim();
  if (commands) {
    for (const command of commands.split("\n"))
      viewer.handle_command_bytearray(Uint8Array.from(atob(command), (sign) => sign.charCodeAt(0)));
  } else viewer.connect("ws://" + location.host + location.pathname + "commands");
  viewer.set_3d_pane_size();
  fit();
  requestAnimationFrame(frame);
  globalThis.Playback = { viewer, camera, player, trails, drones, swarm, labels, picture };
} catch (error) {
  const trouble = document.getElementById("trouble");
  trouble.append(error.message);
  trouble.hidden = false;
}
