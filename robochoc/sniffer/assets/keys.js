"use strict";
/* The keyboard. Keys are left alone where something else has them: in text, on sliders, in lists of choices. */
(() => {
  Sniffer.KEYS = [
    ["↓ or j", "next message"], ["↑ or k", "message before"], ["PgDn, PgUp", "a window further, or back"],
    ["Home, End", "first message, last message"], ["Enter", "read the chosen message"], ["→, ←", "step forward, back"],
    ["], [", "step forward, back, of the chosen robot"], [". ,", "next change of value, the one before, of the chosen robot"],
    ["p", "play, or pause"], ["f", "follow what is newest"],
    ["/", "search"], ["n, N", "next hit, hit before"], ["c, v", "first cause, first consequence"],
    ["+, -", "larger rows, smaller rows"], ["r", "the robot that says the chosen message"], ["Esc", "choose nothing; back to the messages"],
    ["Alt+← or →", "move the lifeline that has the focus"], ["?", "this list"],
  ];
  Sniffer.SIGNS = [
    ["Box on a lifeline", "a step of that robot: what it takes in at once, decides and says"],
    ["Yellow label", "the value it takes in that step"],
    ["Bent arrow", "goes over when it is said, then waits beside the receiver's lifeline for the step that takes it in"],
    ["Straight arrow", "from the step that says it to the step that takes it in"],
    ["Red cross", "it was never taken in; while the run goes on, a dotted arrow is one not taken in yet"],
    ["Pink line", "the moment chosen below; what comes later is faded"],
    ["▴ ▾", "a cause, a consequence, of the chosen message"],
    ["Light lifelines", "sender and receiver of the chosen message; the chosen robot's own line is bold"],
    ["⚑", "found out how the run ends; the verdict above goes to that step"],
    ["Strip on the right", "the whole run: how much is said of which type, where the window is (frame), the moment (pink), hits (yellow); press it to go there"],
    ["⊞", "one lifeline for all robots of a group; ⊟: one for each again"],
    ["others", "one lifeline for all robots that are not chosen"],
    ["Only neighbours", "lifelines for the chosen robot and those it has spoken with"],
    ["Follow", "in a run that goes on: what is newest is shown as it comes"],
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
    Sniffer.byId("help-signs").append(...Sniffer.SIGNS.flatMap(([sign, text]) =>
      [Sniffer.make("dt", {}, sign), Sniffer.make("dd", {}, text)]));
    Sniffer.byId("keys").addEventListener("click", () => help.showModal());
  };
})();
