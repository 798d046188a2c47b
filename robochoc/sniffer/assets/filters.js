"use strict";
/* The filters: types and performatives, senders and receivers, times, and causes and consequences of a message. */
(() => {
  Sniffer.FilterPane = class {
    constructor(model, view, filter) {
      Object.assign(this, { model, view, filter });
      this.element = Sniffer.byId("filters");
      this._build();
    }

    _build() {
      const { make } = Sniffer;
      const { view } = this;
      this.kinds = make("div", { class: "checks" });
      const text = (name, label, placeholder) => {
        const input = make("input", { type: "search", placeholder, spellcheck: false });
        input.addEventListener("input", Sniffer.seldom(150, () => view.set({ [name]: input.value })));
        this[name] = input;
        this[`${name}Unknown`] = make("p", { class: "unknown", role: "status", hidden: true });
        return [make("label", {}, make("span", {}, label), input), this[`${name}Unknown`]];
      };
      const time = (name, label) => {
        const input = make("input", { type: "number", step: "any", inputMode: "decimal" });
        input.addEventListener("input", Sniffer.seldom(150, () => view.set({ [name]: input.value === "" ? null : Number(input.value) })));
        this[name] = input;
        return make("label", {}, make("span", {}, label), input,
          make("button", { type: "button", title: "The moment chosen below", "aria-label": `${label} the moment chosen`,
            onclick: () => view.set({ [name]: this.model.steps.t[view.moment] ?? null }) }, "now"));
      };
      this.run = make("select", { "aria-label": "Run", onchange: () => view.set({ run: Number(this.run.value) }) });
      this.concern = make("select", { "aria-label": "Which messages, by cause and consequence", onchange: () => this._concern(Number(this.concern.value)) },
        ...[["0", "all messages"], ["1", "the message, its causes and consequences"], ["2", "up to distance 2"], ["4", "up to distance 4"],
          ["8", "up to distance 8"], ["1000000000", "at any distance"]].map(([value, name]) => make("option", { value }, name)));
      this.hits = make("input", { type: "checkbox", onchange: () => view.set({ hitsOnly: this.hits.checked }) });
      this.concerned = make("span", { class: "soft" });
      this.element.append(
        make("fieldset", {}, make("legend", {}, "Types"), this.kinds),
        make("fieldset", {}, make("legend", {}, "Robots"), ...text("senders", "From", "Robot1.*, Robot2.3"), ...text("receivers", "To", "any")),
        make("fieldset", {}, make("legend", {}, "Time"), time("from", "From"), time("to", "Until"),
          make("label", {}, make("span", {}, "Run"), this.run)),
        make("fieldset", {}, make("legend", {}, "Cause and consequence"),
          make("label", {}, make("span", {}, "Show"), this.concern), this.concerned),
        make("label", { class: "check" }, this.hits, "Only hits of the search"),
        make("button", { type: "button", onclick: () => this.clear() }, "Show all messages"));
    }

    _concern(depth) {
      if (depth && this.view.selected < 0 && this.view.about < 0) {
        this.concern.value = "0";
        Sniffer.say("Choose a message first");
        this.concerned.textContent = "Choose a message first.";
        return;
      }
      this.view.set({ concern: depth, about: this.view.selected >= 0 ? this.view.selected : this.view.about });
    }

    clear() {
      this.view.set({ off: new Set(), senders: "", receivers: "", run: -1, from: null, to: null, concern: 0, about: -1, hitsOnly: false });
    }

    paint() {
      const { view, model } = this;
      this._types();
      for (const name of ["senders", "receivers"]) {
        if (document.activeElement !== this[name]) this[name].value = view[name];
        this._unknown(view[name], this[`${name}Unknown`]);
      }
      for (const name of ["from", "to"]) if (document.activeElement !== this[name]) this[name].value = view[name] ?? "";
      if (this.run.options.length !== model.about.runs.length + 1)
        Sniffer.fill(this.run, Sniffer.make("option", { value: "-1" }, "all"),
          ...model.about.runs.map((run) => Sniffer.make("option", { value: String(run.number) }, Sniffer.runName(run))));
      this.run.value = String(view.run);
      this.concern.value = String(view.concern);
      this.concerned.textContent = view.concern ? `of message ${Sniffer.count(view.about)}` : "";
      this.hits.checked = view.hitsOnly;
    }

    /* The text for a pattern that matches no robot, with the existing names. */
    _unknown(patterns, element) {
      const { robots } = this.model;
      const parts = patterns.split(",").map((part) => part.trim()).filter(Boolean);
      const key = `${patterns}|${robots.length}`;
      if (element.dataset.of === key) return;
      element.dataset.of = key;
      const unknown = robots.length ? parts.find((part) => !robots.some(Sniffer.matcher(part))) : undefined;
      element.hidden = unknown === undefined;
      const begun = robots.filter((name) => unknown && name.toLowerCase().includes(unknown.toLowerCase()));
      const some = (begun.length ? begun : robots).slice(0, 2).join(" and ");
      element.textContent = element.hidden ? "" : `No robot is named ${unknown}; there ${robots.length > 1 ? "are" : "is"} ${some}.`;
    }

    /* A box for each type, with its colour, dash and count; also for each performative, if these differ from the types. */
    _types() {
      const { view, model } = this;
      const { kinds } = model.about;
      const key = JSON.stringify([kinds.map((_, kind) => model.kindCounts[kind]), [...view.off], Sniffer.palette.dark, view.colourBy]);
      if (this._shown === key) return;
      this._shown = key;
      const focused = this.kinds.contains(document.activeElement) ? document.activeElement.dataset.key : null;
      const acts = [...new Set(kinds.map((kind) => kind.performative).filter(Boolean))];
      const many = acts.length > 1 ? acts.filter((act) => kinds.filter((kind) => kind.performative === act).length > 1) : [];
      Sniffer.fill(this.kinds,
        ...kinds.map((kind, number) => this._type(`kind ${number}`, kind.name, (kind.performative || "").toLowerCase(), [number], Sniffer.uncoded(kind.why || ""))),
        ...many.map((act) => this._type(`act ${act}`, `all ${act.toLowerCase()}`, "",
          kinds.flatMap((kind, number) => (kind.performative === act ? [number] : [])), "")));
      const again = focused && [...this.kinds.querySelectorAll("input")].find((input) => input.dataset.key === focused);
      if (again) again.focus();
    }

    _type(key, name, act, kinds, why) {
      const { make } = Sniffer;
      const { view, model } = this;
      const shown = kinds.filter((kind) => !view.off.has(kind)).length;
      const box = make("input", { type: "checkbox", checked: shown === kinds.length, "data-key": key, onchange: () => {
        for (const kind of kinds) box.checked ? view.off.delete(kind) : view.off.add(kind);
        view.touch("off");
      } });
      box.indeterminate = shown > 0 && shown < kinds.length;
      const swatch = kinds.length === 1 && view.colourBy === "kind" ? make("i", { class: "swatch" }) : null;
      if (swatch) swatch.style.background = Sniffer.palette.colour(kinds[0]);
      const count = kinds.reduce((sum, kind) => sum + model.kindCounts[kind], 0);
      return make("label", { class: "check", title: why }, box, swatch, make("span", {}, name),
        act ? make("small", {}, act) : null, make("small", { class: "end" }, Sniffer.count(count)));
    }
  };

  Sniffer.runName = (run) =>
    `${run.protocol}${run.epoch === null || run.epoch === undefined ? "" : `, epoch ${run.epoch}`}${run.opened_by ? ` (${run.opened_by})` : ""}`;
})();
