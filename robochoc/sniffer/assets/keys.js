"use strict";
/* The keyboard. Keys are not handled in text fields, sliders, and lists of choices, which use them. */
(() => {
  Sniffer.KEYS = [
    ["↓ or j", "next message"], ["↑ or k", "previous message"], ["PgDn, PgUp", "one window forward, or back"],
    ["Home, End", "first message, last message"], ["Enter", "read the chosen message"], ["→, ←", "step forward, back"],
    ["], [", "next, previous step of the chosen robot"], [". ,", "next, previous change of the chosen robot's value"],
    ["p", "play, or pause"], ["f", "follow the newest messages"],
    ["/", "search"], ["n, N", "next, previous hit"], ["c, v", "first cause, first consequence"],
    ["+, -", "larger rows, smaller rows"], ["r", "the sender of the chosen message"], ["Esc", "clear the selection; back to the messages"],
    ["Alt+← or →", "move the lifeline that has the focus"], ["?", "this list"],
  ];
  Sniffer.SIGNS = [
    ["Box on a lifeline", "a step of the robot: it receives messages, decides, and sends messages"],
    ["Yellow label", "the robot's new value in this step"],
    ["Bent arrow", "a message crosses when it is sent, then waits beside the receiver's lifeline until a step receives it"],
    ["Straight arrow", "from the step that sends a message to the step that receives it"],
    ["Red cross", "the message was never received; during a run, a dotted arrow is a message not received yet"],
    ["Pink line", "the moment chosen below; later events are faded"],
    ["▴ ▾", "a cause, a consequence, of the chosen message"],
    ["Light lifelines", "sender and receiver of the chosen message; the chosen robot's own line is bold"],
    ["⚑", "the robot found the verdict of the run; the verdict above leads to this step"],
    ["Strip on the right", "the complete run: messages by type, the window (frame), the moment (pink), hits (yellow); click to go there"],
    ["⊞", "one lifeline for all robots of a group; ⊟: one for each robot again"],
    ["others", "one lifeline for all robots that are not chosen"],
    ["Only neighbours", "lifelines for the chosen robot and the robots that exchange messages with it"],
    ["Follow", "during a run: new messages are shown when they arrive"],
  ];

  const TYPING = "input:not([type=radio], [type=checkbox], [type=range]), select, textarea, [contenteditable]";
  const MOVING = ".scrolls, [role=tablist], [role=separator], #heads, input"; // these elements use arrow keys themselves
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
