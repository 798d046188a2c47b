"use strict";
/* The keyboard. Keys are left alone where something else has them: in text, on sliders, in lists of choices. */
(() => {
  Sniffer.KEYS = [
    ["↓ or j", "next message"], ["↑ or k", "message before"], ["PgDn, PgUp", "a window further, or back"],
    ["Home, End", "first message, last message"], ["Enter", "read the chosen message"], ["→, ←", "step forward, back"],
    ["], [", "step forward, back, of the chosen robot"], ["p", "play, or pause"], ["f", "follow what is newest"],
    ["/", "search"], ["n, N", "next hit, hit before"], ["c, v", "first cause, first consequence"],
    ["+, -", "larger rows, smaller rows"], ["r", "the robot that says the chosen message"], ["Esc", "choose nothing; back to the messages"],
    ["Alt+← or →", "move the lifeline that has the focus"], ["?", "these keys"],
  ];

  const TYPING = "input:not([type=radio], [type=checkbox], [type=range]), select, textarea, [contenteditable]";
  const MOVING = ".scrolls, [role=tablist], [role=separator], #heads, input"; // there arrows and the like have a meaning
  const SCROLLING = new Set(["ArrowUp", "ArrowDown", "PageUp", "PageDown", "Home", "End", "ArrowLeft", "ArrowRight"]);

  Sniffer.keys = (does) => {
    document.addEventListener("keydown", (event) => {
      if (event.key === "Escape") return void does.Escape(event);
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest(TYPING) || document.querySelector("dialog[open]")) return;
      if (SCROLLING.has(event.key) && event.target.closest(MOVING)) return;
      if (event.key === "Enter" && event.target.closest("button, a, summary, input")) return;
      const action = does[event.key];
      if (!action) return;
      event.preventDefault();
      action();
    });
    const help = Sniffer.byId("help");
    Sniffer.byId("help-keys").append(...Sniffer.KEYS.flatMap(([key, text]) =>
      [Sniffer.make("dt", {}, Sniffer.make("kbd", {}, key)), Sniffer.make("dd", {}, text)]));
    Sniffer.byId("keys").addEventListener("click", () => help.showModal());
  };
})();
