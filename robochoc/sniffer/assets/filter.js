"use strict";
/* The shown messages as rows, in order. Without a filter there is no list: row numbers are message numbers. */
(() => {
  Sniffer.Filter = class {
    constructor(model, view, search) {
      Object.assign(this, { model, view, search });
      this.rows = null;
      this.done = 0;
    }

    get length() {
      return this.rows ? this.rows.length : this.done;
    }

    at(row) {
      return this.rows ? this.rows.all[row] : row;
    }

    /* The row of a message, or of the next one that is shown. */
    rowOf(message) {
      return this.rows ? Sniffer.lowerBound(this.rows.all, message, this.rows.length) : Math.min(message, this.done);
    }

    shows(message) {
      return !this.rows ? message < this.done : this.at(this.rowOf(message)) === message && this.rowOf(message) < this.length;
    }

    /* Whether there are filters other than the choice of robots. */
    get narrowed() {
      const { view } = this;
      return Boolean(view.off.size || view.senders || view.receivers || view.run >= 0 || view.from !== null ||
        view.to !== null || this._concerned || (view.hitsOnly && view.query));
    }

    rebuild() {
      const { model, view } = this;
      const robots = model.ownSteps.length;
      const named = (patterns) => {
        const matches = Sniffer.matcher(patterns);
        return patterns.trim() ? Uint8Array.from({ length: robots }, (_, robot) => Number(matches(model.nameOf(robot)))) : null;
      };
      this._robots = robots;
      this._senders = named(view.senders);
      this._receivers = named(view.receivers);
      this._chosen = view.chosen.size < model.robots.length
        ? Uint8Array.from({ length: robots }, (_, robot) => Number(view.chosen.has(robot))) : null;
      this._concerned = view.concern && view.about >= 0 ? concerned(model, view.about, view.concern) : null;
      this.rows = this.narrowed || this._chosen ? new Sniffer.Growing(Uint32Array) : null;
      this.done = 0;
      this.extend();
    }

    /* Adds the messages that were loaded since the last call. */
    extend() {
      const { model, view, rows } = this;
      if (model.ownSteps.length !== this._robots) return this.rebuild();
      const to = model.messageCount;
      if (!rows) {
        this.done = to;
        return undefined;
      }
      const { sender, receiver, kind, run, t } = model.messages;
      const { _senders: senders, _receivers: receivers, _chosen: chosen, _concerned: about } = this;
      const off = new Uint8Array(65536);
      for (const type of view.off) off[type] = 1;
      const hits = view.hitsOnly && view.query ? this.search.marks : null;
      const from = view.from === null ? -Infinity : view.from;
      const until = view.to === null ? Infinity : view.to;
      for (let m = this.done; m < to; m++) {
        if (off[kind[m]] || (chosen && !chosen[sender[m]] && !chosen[receiver[m]])) continue;
        if ((senders && !senders[sender[m]]) || (receivers && !receivers[receiver[m]])) continue;
        if ((view.run >= 0 && run[m] !== view.run) || t[m] < from || t[m] > until) continue;
        if ((about && !about.has(m)) || (hits && !hits.has(m))) continue;
        rows.push(m);
      }
      this.done = to;
      return undefined;
    }
  };

  /* `message` with its causes and consequences, up to a distance of `depth` messages. */
  const concerned = (model, message, depth) => {
    const found = new Set([message]);
    for (const next of [(m) => model.causesOf(m), (m) => model.consequencesOf(m)]) {
      const seen = new Set([message]); // visited in this direction: a message may be both a cause and a consequence
      let edge = [message];
      for (let far = 0; far < depth && edge.length; far++) {
        const further = [];
        for (const m of edge)
          for (const other of next(m))
            if (!seen.has(other)) {
              seen.add(other);
              found.add(other);
              further.push(other);
            }
        edge = further;
      }
    }
    return found;
  };
})();
