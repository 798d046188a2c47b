"use strict";
/* Notices on the run, shown above it: damage, losses, missing data, the end of the server. */
(() => {
  const SHOWN = 3; // the maximum number of notices of one kind; others are counted

  Sniffer.Notices = class {
    constructor(model, following, handlers) {
      Object.assign(this, { model, following, handlers });
      this.element = Sniffer.byId("notices");
      this.closed = new Set();
    }

    paint() {
      const { about } = this.model;
      const { following } = this;
      const said = [];
      if (following.gone) said.push(["gone", "The server of this page has ended. The loaded data remain; other data are not available any more."]);
      else if (following.trouble) said.push(["trouble", `Not all data could be loaded: ${following.trouble}`]);
      if (about.damage) said.push(["damage", `The journal is damaged and incomplete: ${about.damage}`]);
      if (about.over && !about.outcome && !about.damage) said.push(["broken", "The run was interrupted: the journal has no outcome. All its content is shown."]);
      if (about.over && !about.messages) said.push(["empty", "There are no messages in this run."]);
      if (about.unseen) said.push(["unseen", `The sending of ${Sniffer.many(about.unseen, "received message", "received messages")} is not in the journal: there is no arrow.`]);
      if (about.replay) said.push(["replay", `The robots' states are not available: ${about.replay}`]);
      const kept = [...(about.notes || []), ...(about.losses || []), ...(about.refusals || [])].filter((note) => !note.kind || ["lost", "refused"].includes(note.kind));
      const shown = kept.slice(0, SHOWN);
      for (const note of shown) said.push([`note ${note.step} ${note.text}`, `${note.text} (t = ${Sniffer.moment(note.t)})`, note.step]);
      if (kept.length > SHOWN) said.push(["notes", `and ${Sniffer.count(kept.length - SHOWN)} more losses and refusals`]);
      const open = said.filter(([key]) => !this.closed.has(key));
      const all = JSON.stringify(open);
      if (all === this._shown) return;
      this._shown = all;
      Sniffer.fill(this.element, ...open.map(([key, text, step]) => this._notice(key, text, step)));
      if (open.length) Sniffer.say(open[0][1]);
    }

    _notice(key, text, step) {
      const { make } = Sniffer;
      return make("p", { class: `notice ${key.split(" ")[0]}` }, make("span", {}, ...Sniffer.coded(text)),
        step === undefined ? null : make("button", { type: "button", onclick: () => this.handlers.step(step) }, "Show"),
        make("button", { type: "button", class: "plain", "aria-label": `Close: ${text}`, title: "Close", onclick: () => {
          this.closed.add(key);
          this.paint();
        } }, "×"));
    }
  };
})();
