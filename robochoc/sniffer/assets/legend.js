"use strict";
/* The meaning of colours by performative, conversation, or sender; colours of types are explained at the filters. */
(() => {
  const NAMED = 3; // the maximum number of listed names with one colour; the others are in its tooltip

  const names = (about, robots, by) => {
    if (by === "run") return about.runs.map((run) => Sniffer.runName(run));
    if (by === "sender") return robots;
    return by === "performative" ? [...new Set(about.kinds.map((kind) => kind.performative.toLowerCase()))] : [];
  };

  Sniffer.Legend = class {
    constructor(model, view) {
      Object.assign(this, { model, view });
      this.element = Sniffer.byId("legend");
    }

    paint() {
      const { make, palette } = Sniffer;
      const all = names(this.model.about, this.model.robots, this.view.colourBy);
      const key = JSON.stringify([this.view.colourBy, all, palette.dark]);
      if (key === this._shown) return;
      this._shown = key;
      this.element.hidden = !all.length;
      Sniffer.fill(this.element, ...all.slice(0, palette.count).map((_, colour) => {
        const mark = make("i", { class: "swatch" });
        mark.style.background = palette.colour(colour);
        const same = all.filter((_name, place) => place % palette.count === colour);
        const some = same.slice(0, NAMED).join(", ");
        return make("span", { title: same.slice(0, 100).join(", ") }, mark, same.length > NAMED ? `${some} …` : some);
      }));
    }
  };
})();
