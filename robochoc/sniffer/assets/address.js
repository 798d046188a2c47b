"use strict";
/* The view in the fragment of the page's address, for reloads and bookmarks. Only differences from the initial view are
   written. */
(() => {
  /* 0,1,2,5 as 0-2,5 */
  const ranges = (numbers) => {
    const parts = [];
    for (let i = 0; i < numbers.length; ) {
      let end = i;
      while (end + 1 < numbers.length && numbers[end + 1] === numbers[end] + 1) end++;
      parts.push(end > i ? `${numbers[i]}-${numbers[end]}` : `${numbers[i]}`);
      i = end + 1;
    }
    return parts.join(",");
  };
  const numbers = (text, below) => {
    const found = [];
    for (const part of text.split(",")) {
      const [from, to = from] = part.split("-").map(Number);
      if (!Number.isInteger(from) || !Number.isInteger(to)) continue;
      for (let number = from; number <= to && number < below; number++) found.push(number);
    }
    return [...new Set(found)];
  };

  const TEXTS = ["layout", "upper", "lower", "colourBy", "arrows", "whose", "senders", "receivers", "query"];
  const NUMBERS = ["selected", "robot", "moment", "top", "left", "rowHeight", "laneWidth", "run", "from", "to", "concern", "about"];
  const ALLOWED = { layout: ["chart", "both", "table"], upper: ["message", "robot"], lower: ["counters", "scene"],
    colourBy: ["kind", "performative", "run", "sender"], whose: ["all", "one"],
    arrows: ["bent", "straight"] };

  Sniffer.Address = class {
    /* `keepsMoment`: whether the user has chosen the moment; otherwise it is the present end of the run. */
    constructor(model, view, keepsMoment) {
      Object.assign(this, { model, view, keepsMoment });
      this.save = Sniffer.seldom(250, () => this._save());
    }

    /* The initial view: called before any change. */
    begin() {
      this.first = this._entries();
    }

    _entries() {
      const { view } = this;
      const entries = new Map();
      for (const name of TEXTS) entries.set(name, view[name]);
      for (const name of NUMBERS) entries.set(name, view[name] === null ? "" : String(Math.round(view[name] * 100) / 100));
      entries.set("robots", ranges([...view.chosen].sort((one, other) => one - other)));
      entries.set("order", ranges(view.order));
      entries.set("groups", JSON.stringify([...view.collapsed].sort()));
      entries.set("patterns", JSON.stringify(view.patterns));
      entries.set("off", ranges([...view.off].sort((one, other) => one - other)));
      entries.set("follow", String(view.follow));
      entries.set("hits", view.hitsOnly ? "only" : "");
      return entries;
    }

    _save() {
      if (!this.first) return;
      const parts = new URLSearchParams();
      const moved = (name, value) => (name === "moment" ? this.keepsMoment() && (this.view.selected >= 0 || value !== this.first.get(name))
        : value !== this.first.get(name));
      for (const [name, value] of this._entries()) if (moved(name, value)) parts.set(name, value);
      const hash = `#${parts}`;
      if (hash === location.hash || (hash === "#" && !location.hash)) return;
      this.own = hash;
      try {
        history.replaceState(null, "", hash);
      } catch {
        /* some viewers of files do not allow it; then a reload shows the initial view */
      }
    }

    /* Applies the address. Returns the positions in the run, which are used when these parts are loaded. Without a
       moment, the page shows the step of the selected message. */
    read() {
      const { view, model } = this;
      const parts = new URLSearchParams(location.hash.slice(1));
      const robots = model.robots.length;
      const changes = {};
      for (const name of TEXTS) {
        const value = parts.get(name);
        if (value !== null && (!ALLOWED[name] || ALLOWED[name].includes(value))) changes[name] = value.slice(0, 1000);
      }
      for (const name of NUMBERS) {
        const value = parts.get(name);
        if (value !== null && value !== "" && Number.isFinite(Number(value))) changes[name] = Number(value);
      }
      if (parts.has("robots")) changes.chosen = new Set(numbers(parts.get("robots"), robots));
      if (parts.has("order")) {
        const order = numbers(parts.get("order"), robots);
        const placed = new Set(order);
        changes.order = order.concat(view.order.filter((robot) => !placed.has(robot)));
      }
      for (const [name, key, wrap] of [["groups", "collapsed", (list) => new Set(list)], ["patterns", "patterns", (list) => list]]) {
        if (!parts.has(name)) continue;
        try {
          const list = JSON.parse(parts.get(name));
          if (Array.isArray(list)) changes[key] = wrap(list.filter((entry) => typeof entry === "string").slice(0, 1000));
        } catch {
          /* invalid parts of an edited address are ignored */
        }
      }
      if (parts.has("off")) changes.off = new Set(numbers(parts.get("off"), 65536));
      if (parts.has("follow")) changes.follow = parts.get("follow") === "true";
      if (parts.has("hits")) changes.hitsOnly = parts.get("hits") === "only";
      const { top, moment, selected, ...now } = changes;
      if (now.robot >= robots) now.robot = -1;
      if (now.rowHeight) now.rowHeight = Math.min(Math.max(now.rowHeight, 2), 64);
      view.set(now);
      return { top, moment, selected, withoutMoment: moment === undefined };
    }
  };
})();
