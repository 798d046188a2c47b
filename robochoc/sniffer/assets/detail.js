"use strict";
/* One message in full: in words, all fields of the ACL message, its content, causes and consequences. */
(() => {
  const LINKS = 60; // of a larger packet, only the number is shown
  const ENTRIES = 500; // the maximum number of shown entries of a list

  /* JSON as a tree. Inner levels are created when they are opened, so that untrusted content of any size is harmless. */
  Sniffer.tree = (value, name, depth = 0) => {
    const { make } = Sniffer;
    const label = name === undefined ? null : make("b", {}, `${name}: `);
    if (value === null || typeof value !== "object") return make("div", { class: "leaf" }, label, make("code", {}, JSON.stringify(value)));
    const entries = Object.entries(value);
    const brief = Array.isArray(value) ? `[ ${entries.length} ]` : `{ ${entries.length} }`;
    const branch = make("details", { class: "branch" }, make("summary", {}, label, make("code", {}, brief)));
    const open = () => {
      if (!branch.open || branch.childElementCount > 1) return;
      branch.append(...entries.slice(0, ENTRIES).map(([key, inner]) => Sniffer.tree(inner, key, depth + 1)));
      if (entries.length > ENTRIES) branch.append(make("p", { class: "soft" }, `and ${Sniffer.count(entries.length - ENTRIES)} more`));
    };
    branch.addEventListener("toggle", open);
    branch.open = depth < 2 && entries.length <= 12;
    open();
    return branch;
  };

  /* A button that goes to a message. */
  Sniffer.link = (model, message, handlers) => {
    const { make } = Sniffer;
    const { sender, receiver } = model.messages;
    const mark = make("i", { class: "swatch" });
    mark.style.background = Sniffer.palette.colour(model.messages.kind[message]);
    return make("li", {}, make("button", { type: "button", class: "plain link", onclick: () => handlers.message(message) },
      mark, make("b", {}, Sniffer.count(message)), ` ${model.kindOf(message).name} `,
      make("span", { class: "soft" }, `${model.nameOf(sender[message])} → ${model.nameOf(receiver[message])}`)));
  };

  Sniffer.links = (model, messages, handlers, none) => {
    const list = [...messages.slice(0, LINKS)].map((message) => Sniffer.link(model, message, handlers));
    if (messages.length > LINKS) list.push(Sniffer.make("li", { class: "soft" }, `and ${Sniffer.count(messages.length - LINKS)} more`));
    return list.length ? Sniffer.make("ul", { class: "links" }, ...list) : Sniffer.make("p", { class: "soft" }, none);
  };

  Sniffer.facts = (pairs) => Sniffer.make("dl", { class: "facts" }, ...pairs.flatMap(([name, fact]) =>
    (fact === "" || fact === null || fact === undefined ? [] : [Sniffer.make("dt", {}, name), Sniffer.make("dd", {}, fact)])));

  Sniffer.copyButton = (text) => {
    const button = Sniffer.make("button", { type: "button", onclick: async () => {
      try {
        await navigator.clipboard.writeText(text);
        button.textContent = "Copied";
        Sniffer.say("Copied");
      } catch {
        button.textContent = "The browser does not allow copying";
      }
      setTimeout(() => (button.textContent = "Copy"), 1500);
    } }, "Copy");
    return button;
  };

  Sniffer.Detail = class {
    constructor(model, view, source, texts, saving, handlers) {
      Object.assign(this, { model, view, source, texts, saving, handlers });
      this.element = Sniffer.byId("message");
    }

    paint() {
      const { view, model } = this;
      const m = view.selected;
      if (m < 0 || m >= model.messageCount) {
        this._key = "";
        Sniffer.fill(this.element, Sniffer.make("p", { class: "hint" }, m < 0
          ? "Choose a message: click its arrow, or its row in the table. Its words, causes and consequences are shown here."
          : `Message ${Sniffer.count(m)} has not been loaded yet.`));
        return;
      }
      const key = `${m}|${model.receivedStep[m]}|${model.concluded.size}|${model.whole}|${Sniffer.palette.dark}|${model.consequencesOf(m).length}`;
      if (key === this._key) return;
      this._key = key;
      this._show(m);
    }

    _show(m) {
      const { make, count, moment } = Sniffer;
      const { model, handlers } = this;
      const { sender, receiver, t, step, bytes, clock } = model.messages;
      const kind = model.kindOf(m);
      const taken = model.receivedStep[m];
      const from = model.nameOf(sender[m]);
      const to = model.nameOf(receiver[m]);
      const mark = make("i", { class: "swatch big" });
      mark.style.background = Sniffer.palette.colour(model.messages.kind[m]);
      const robot = (number) => make("button", { type: "button", class: "plain robot", onclick: () => handlers.robot(number) }, model.nameOf(number));
      this.words = make("blockquote", {}, "…");
      this.why = make("div");
      this.more = make("div");
      const causes = model.causesOf(m);
      const fate = taken === Sniffer.NONE ? (model.whole ? "never" : "not yet")
        : `t = ${moment(model.steps.t[taken])}, after ${moment(model.steps.t[taken] - t[m])}`;
      Sniffer.fill(this.element,
        make("h2", {}, mark, `${count(m)} ${kind.name}`),
        make("p", { class: "who" }, robot(sender[m]), " → ", robot(receiver[m])),
        this.words,
        kind.why ? make("p", { class: "soft" }, ...Sniffer.coded(kind.why)) : null,
        this.why,
        make("h3", {}, "Causes"),
        Sniffer.links(model, causes, handlers, this._uncaused(sender[m], step[m])),
        make("h3", {}, "Consequences"),
        Sniffer.links(model, model.consequencesOf(m), handlers, taken !== Sniffer.NONE ? this._quietly(receiver[m], taken)
          : model.whole ? `${to} never received it.` : `${to} has not received it yet.`),
        make("h3", {}, "When"),
        Sniffer.facts([["Said", `t = ${moment(t[m])}`], ["Received", fate], ["Run", Sniffer.runName(model.runOf(m) || { protocol: "?" })],
          ["Step", `${count(step[m] + 1)}, ${from}'s ${count(model.ordinal[step[m]] + 1)}`],
          ["NCCC clock", count(clock[m])], ["Size", Sniffer.many(bytes[m], "byte")]]),
        this.more,
        this.saving.panel(m));
      this.element.scrollTop = 0;
      this._details(m);
      this._reasons(m);
    }

    /* Shows the sender's reasons in the step of the message. The panel "Robot" reports errors. */
    async _reasons(m) {
      const { model, why } = this;
      if (model.about.replay) return;
      const own = model.ordinal[model.messages.step[m]];
      const states = await this.source.states(model.messages.sender[m], Math.floor(own / Sniffer.STATES), (own % Sniffer.STATES) + 1).catch(() => []);
      const state = states[own % Sniffer.STATES];
      if (state && this.why === why) Sniffer.fill(why, Sniffer.why(state));
    }

    /* The reason for a message without a cause. */
    _uncaused(robot, step) {
      const { model } = this;
      const before = model.ordinal[step] ? model.ownSteps[robot].all[model.ordinal[step] - 1] : -1;
      const begins = before < 0 || model.steps.run[before] !== model.steps.run[step];
      const name = model.nameOf(robot);
      return begins ? `${name} sent it at its start, before it received any message.`
        : `The messages that ${name} received before are not in this journal.`;
    }

    /* The consequence of a message without further messages. */
    _quietly(robot, step) {
      const found = this.model.concludedIn.get(step);
      const name = this.model.nameOf(robot);
      return found && found.robot === robot ? `${name} received it, and ${found.text}.` : `${name} received it and sent nothing.`;
    }

    async _details(m) {
      const { make } = Sniffer;
      let detail;
      try {
        detail = await this.texts.detail(m);
      } catch (trouble) {
        if (this.view.selected === m) this.words.textContent = `The message cannot be loaded: ${trouble.message}`;
        return;
      }
      if (this.view.selected !== m || !detail) return;
      this.words.textContent = detail.words;
      Sniffer.fill(this.more,
        make("h3", {}, "Its content"), Sniffer.tree(detail.content),
        make("h3", {}, "As a FIPA ACL message"),
        Sniffer.facts(Object.entries(detail.fields).map(([name, text]) => [name, make("code", {}, text)])),
        make("details", {}, make("summary", {}, "As text"), make("pre", { tabIndex: 0 }, detail.acl), Sniffer.copyButton(detail.acl)));
      Sniffer.say(detail.words, false);
    }
  };
})();
