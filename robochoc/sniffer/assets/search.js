"use strict";
/* Text search in the words, names and contents of messages. A search runs in the background, from the first message on,
   part by part, and can be cancelled. A server searches by itself; an exported page searches the messages it contains. */
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
      const { model, source, query } = this;
      while (this.looked < model.messageCount) {
        const { hits, to } = await source.search(query, this.looked, model.messageCount, (...hit) => this._isHit(...hit));
        if (turn !== this._turn) return;
        this.looked = to;
        for (const message of hits) {
          this.hits.push(message);
          this.marks.add(message);
        }
        this.changed(hits.length > 0);
      }
    }

    _isHit(message, detail) {
      const { model } = this;
      const names = `${model.nameOf(model.messages.sender[message])} ${model.nameOf(model.messages.receiver[message])}`;
      const kind = model.kindOf(message);
      return `${detail.words}\n${names}\n${kind.name} ${kind.performative}\n${JSON.stringify(detail.content)}`
        .toLowerCase().includes(this.query);
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
