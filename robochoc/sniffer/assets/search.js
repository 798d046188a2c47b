"use strict";
/* Text search in the words of messages. The server computes words on request, a thousand messages at a time, so a
   search runs in the background, from the first message, and can be cancelled. */
(() => {
  const CHUNK = 1024;

  Sniffer.CHUNK = CHUNK;

  Sniffer.Search = class {
    constructor(model, source, changed) {
      Object.assign(this, { model, source, changed });
      this.clear();
    }

    clear() {
      this.query = "";
      this.hits = []; // messages, in order
      this.marks = new Set();
      this.looked = 0;
      this.running = false;
      this.trouble = "";
      this._searched = new Map(); // chunk -> the number of searched messages
      this._turn = (this._turn || 0) + 1;
    }

    /* Starts a search if the query has changed; continues with new messages otherwise. */
    async find(query) {
      const wanted = query.trim().toLowerCase();
      if (wanted !== this.query) {
        this.clear();
        this.query = wanted;
      }
      if (!wanted || this.running) return this.changed();
      const turn = this._turn;
      this.running = true;
      this.changed();
      try {
        await this._through(turn);
      } catch (trouble) {
        if (turn === this._turn) this.trouble = trouble.message;
      }
      if (turn !== this._turn) return undefined;
      this.running = false;
      return this.changed();
    }

    async _through(turn) {
      const chunks = Math.ceil(this.model.messageCount / CHUNK);
      for (let chunk = 0; chunk < chunks; chunk++) {
        const there = Math.min(this.model.messageCount - chunk * CHUNK, CHUNK);
        const before = this._searched.get(chunk) || 0;
        if (before >= there) continue;
        const details = await this.source.details(chunk, there);
        if (turn !== this._turn) return;
        const found = [];
        for (let at = before; at < details.length; at++)
          if (this._isHit(chunk * CHUNK + at, details[at])) found.push(chunk * CHUNK + at);
        this._searched.set(chunk, details.length);
        this.looked += details.length - before;
        this._keep(found);
        this.changed(found.length > 0);
      }
    }

    _isHit(message, detail) {
      const { model } = this;
      const names = `${model.nameOf(model.messages.sender[message])} ${model.nameOf(model.messages.receiver[message])}`;
      const kind = model.kindOf(message);
      return `${detail.words}\n${names}\n${kind.name} ${kind.performative}\n${JSON.stringify(detail.content)}`
        .toLowerCase().includes(this.query);
    }

    _keep(found) {
      if (!found.length) return;
      for (const message of found) this.marks.add(message);
      const at = Sniffer.lowerBound(this.hits, found[0]);
      this.hits = this.hits.slice(0, at).concat(found, this.hits.slice(at));
    }

    /* The next hit after `message` (previous: `step` -1) that satisfies `shown`, cyclically; -1: none. */
    next(message, step, shown) {
      const { hits } = this;
      if (!hits.length) return -1;
      const at = Sniffer.lowerBound(hits, step > 0 ? message + 1 : message);
      for (let i = 0; i < hits.length; i++) {
        const place = step > 0 ? at + i : at - 1 - i;
        const hit = hits[(((place % hits.length) + hits.length) % hits.length)];
        if (shown(hit)) return hit;
      }
      return -1;
    }
  };
})();
