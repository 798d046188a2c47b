"use strict";
/* The view chosen by the user. `set` makes changes, and calls the listeners once afterwards. */
(() => {
  const ROW = 24;

  Sniffer.View = class {
    constructor() {
      this._listeners = [];
      this._changed = new Set();
      Object.assign(this, {
        moment: 0, // the step that was the last one at that time
        selected: -1, // a message
        robot: -1,
        chosen: new Set(), // numbers of robots with a lifeline
        order: [], // numbers of all robots, from left to right
        patterns: [], // groups by pattern, in addition to those by row
        collapsed: new Set(), // names of groups with a common lifeline
        rowHeight: ROW,
        laneWidth: 0, // 0: all lifelines in the window, if they are readable
        top: 0, // rows above the window
        left: 0, // pixels to the left of the window
        layout: "both",
        upper: "message",
        lower: "counters",
        colourBy: "kind",
        arrows: "bent", // or straight
        whose: "all",
        follow: false,
        off: new Set(), // numbers of hidden types
        senders: "",
        receivers: "",
        run: -1,
        from: null,
        to: null,
        concern: 0, // how far causes and consequences of `about` are followed; 0: not at all
        about: -1,
        query: "",
        hitsOnly: false,
      });
    }

    static get ROW() {
      return ROW;
    }

    set(changes) {
      let any = false;
      for (const [name, value] of Object.entries(changes)) {
        if (Object.is(this[name], value)) continue;
        this[name] = value;
        this._changed.add(name);
        any = true;
      }
      if (any && !this._told) {
        this._told = true;
        queueMicrotask(() => this._tell());
      }
    }

    /* For sets and lists changed in place. */
    touch(...names) {
      for (const name of names) this._changed.add(name);
      if (this._told) return;
      this._told = true;
      queueMicrotask(() => this._tell());
    }

    on(listener) {
      this._listeners.push(listener);
    }

    _tell() {
      this._told = false;
      const changed = this._changed;
      this._changed = new Set();
      for (const listener of this._listeners) listener(changed);
    }
  };
})();
