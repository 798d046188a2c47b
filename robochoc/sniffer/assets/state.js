"use strict";
/* The state of a robot at the moment: its agent view, remaining values with reasons, actions of this step, and changes of
   its value. */
(() => {
  const CHUNK = 64;
  Sniffer.STATES = CHUNK;
  const MOST = 200; // the maximum number of shown entries of a list
  const BACK = 8; // the number of chunks that are searched for the reason of the end

  /* The reason why there are no states after this one; empty: there may be more. */
  const ending = (state) => {
    const note = state && state.more && state.more.replay;
    return note && note.startsWith("ends here") ? note.replace(/^ends here: */, "") : "";
  };

  /* The reasons of a robot in a step; null if there are none. */
  Sniffer.why = (state) => {
    const { make } = Sniffer;
    const why = [state.why || []].flat();
    return why.length ? make("div", { class: "why" }, make("h3", {}, "Why"),
      make("ul", {}, ...why.slice(0, MOST).map((reason) => make("li", {}, ...Sniffer.coded(reason))))) : null;
  };

  Sniffer.StatePane = class {
    constructor(model, view, source, handlers) {
      Object.assign(this, { model, view, source, handlers });
      this.element = Sniffer.byId("robot");
      this._turn = 0;
    }

    paint() {
      const { view, model } = this;
      const { robot } = view;
      if (robot < 0 || robot >= model.ownSteps.length) {
        this._key = "";
        Sniffer.fill(this.element, Sniffer.make("p", { class: "hint" },
          "Choose a robot: click its name above its lifeline. Its agent view, domain and nogoods at the moment are shown here."));
        return;
      }
      const own = model.ownStepAt(robot, view.moment);
      const here = own >= 0 && model.ownSteps[robot].all[own] === view.moment;
      const key = `${robot}|${own}|${here}|${model.concluded.size}|${model.whole}|${Sniffer.palette.dark}|${own < model.ownSteps[robot].length - 1}`;
      if (key === this._key) return;
      this._key = key;
      this._show(robot, own);
    }

    _show(robot, own) {
      const { make, count } = Sniffer;
      const { model, handlers } = this;
      const steps = model.ownSteps[robot];
      const step = own >= 0 ? steps.all[own] : -1;
      const go = (to, text) => make("button", { type: "button", disabled: to < 0 || to >= steps.length, onclick: () => handlers.step(steps.all[to]) }, text);
      const changes = model.decided[robot].step;
      const change = Sniffer.lowerBound(changes.all, step, changes.length);
      const next = changes.all[change] === step && change < changes.length ? change + 1 : change;
      const mind = (at, text) => make("button", { type: "button", disabled: at < 0 || at >= changes.length, onclick: () => handlers.step(changes.all[at]) }, text);
      const held = this.element.contains(document.activeElement) ? document.activeElement.textContent : "";
      this.state = make("div", { class: "state" }, make("p", { class: "soft" }, "…"));
      const variables = (model.about.robots[robot] || {}).variables || [];
      Sniffer.fill(this.element,
        make("h2", {}, model.nameOf(robot)),
        make("p", { class: "value" }, own < 0 ? "has not started" : model.valueAt(robot, step) || "no value"),
        make("p", { class: "soft" }, own < 0 ? variables.join(", ")
          : `its ${step < this.view.moment ? "last step before this moment:" : "step"} ${count(own + 1)} of ${count(steps.length)}; `
            + `step ${count(step + 1)} of all, t = ${Sniffer.moment(model.steps.t[step])}`),
        model.concluded.has(robot) ? make("p", { class: "concluded" },
          make("button", { type: "button", class: "plain robot", onclick: () => handlers.step(model.concluded.get(robot).step) }, `⚑ It ${model.concluded.get(robot).text}`)) : null,
        make("div", { class: "buttons" }, go(own - 1, "‹ Step"), go(own + 1, "Step ›"),
          mind(change - 1, "‹ Value"), mind(next, "Value ›")),
        this.state,
        ...(own < 0 ? [] : this._doing(step)));
      if (held) {
        const again = [...this.element.querySelectorAll("button")].find((button) => button.textContent === held && !button.disabled);
        if (again) again.focus({ preventScroll: true });
      }
      this._states(robot, own);
    }

    /* The part of a step that is known from the columns, also without a replay. */
    _doing(step) {
      const { make } = Sniffer;
      const { model, handlers } = this;
      return [
        make("h3", {}, "Received"), Sniffer.links(model, model.packetOf(step), handlers, "nothing: this is its start"),
        make("h3", {}, "Sent"), Sniffer.links(model, model.saidIn(step), handlers, "nothing"),
        make("h3", {}, "Counters"),
        Sniffer.facts([["NCCC clock", Sniffer.count(model.steps.clock[step])], ["Constraint checks", Sniffer.count(model.steps.checks[step])]]),
      ];
    }

    async _states(robot, own) {
      const turn = ++this._turn;
      const { make } = Sniffer;
      const target = this.state;
      const { replay } = this.model.about;
      if (own < 0) return void Sniffer.fill(target);
      if (replay) return void Sniffer.fill(target, make("p", { class: "notice" }, make("span", {}, "Its state is not available: ", ...Sniffer.coded(replay))));
      try {
        let chunk = Math.floor(own / CHUNK);
        let states = await this.source.states(robot, chunk, (own % CHUNK) + 1);
        const state = states[own % CHUNK];
        for (let looked = 0; !states.length && chunk > 0 && looked < BACK && turn === this._turn; looked++) states = await this.source.states(robot, --chunk);
        if (turn !== this._turn) return undefined;
        const end = ending(state || states[states.length - 1]);
        if (end) Sniffer.fill(target, make("p", { class: "notice" }, make("span", {}, "Its later states are not available: ", ...Sniffer.coded(end))));
        else if (!state) Sniffer.fill(target, make("p", { class: "soft" }, "Its state after this step is not computed yet."));
        else this._fill(target, state);
      } catch (trouble) {
        if (turn === this._turn) Sniffer.fill(target, make("p", { class: "notice" }, `Its state cannot be loaded: ${trouble.message}`));
      }
      return undefined;
    }

    _fill(target, state) {
      const { make } = Sniffer;
      const list = (entries, none, entry) => (entries.length
        ? make("ul", { class: "knows" }, ...entries.slice(0, MOST).map(entry),
          entries.length > MOST ? make("li", { class: "soft" }, `and ${Sniffer.count(entries.length - MOST)} more`) : null)
        : make("p", { class: "soft" }, none));
      const left = state.domain.filter((value) => !value.ruled_out_by).length;
      Sniffer.fill(target,
        Sniffer.why(state),
        make("h3", {}, "Agent view"),
        state.view.length ? Sniffer.facts(state.view.map(([who, text]) => [who, text || "–"])) : make("p", { class: "soft" }, "It does not know any other robot's value yet."),
        make("h3", {}, `Domain, ${Sniffer.count(left)} of ${Sniffer.count(state.domain.length)} left`),
        list(state.domain, "none", (value) => make("li", { class: value.ruled_out_by ? "out" : "left" },
          make("b", {}, value.ruled_out_by ? make("s", {}, value.value) : value.value),
          value.ruled_out_by ? make("span", {}, " ruled out by ", ...Sniffer.coded(value.ruled_out_by)) : null)),
        make("h3", {}, `Stored nogoods, ${Sniffer.count(state.nogoods.length)}`),
        list(state.nogoods, "none", (nogood) => make("li", {}, nogood)),
        Object.keys(state.more).length ? make("h3", {}, "Further data") : null,
        Object.keys(state.more).length ? Sniffer.facts(Object.entries(state.more)) : null);
    }
  };
})();
