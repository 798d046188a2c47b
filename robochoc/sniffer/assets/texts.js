"use strict";
/* The words of shown messages, loaded in chunks of a thousand messages; the last chunks are cached. */
(() => {
  const KEPT = 16;
  const LONGEST = 400; // the maximum number of characters in a row or tooltip; the message panel has the complete text

  Sniffer.Texts = class {
    constructor(model, source, changed) {
      Object.assign(this, { model, source, changed });
      this._chunks = new Map();
      this._asked = new Set();
      this.trouble = "";
    }

    has(chunk) {
      const details = this._chunks.get(chunk);
      return Boolean(details) && details.length >= Math.min(this.model.messageCount - chunk * Sniffer.CHUNK, Sniffer.CHUNK);
    }

    words(message) {
      const details = this._chunks.get(message >> 10);
      const detail = details && details[message & 1023];
      return detail ? detail.words.slice(0, LONGEST) : "";
    }

    async ask(chunks) {
      for (const chunk of chunks) {
        if (this._asked.has(chunk)) continue;
        this._asked.add(chunk);
        try {
          const least = Math.min(this.model.messageCount - chunk * Sniffer.CHUNK, Sniffer.CHUNK);
          this._chunks.delete(chunk);
          this._chunks.set(chunk, await this.source.details(chunk, least));
          if (this._chunks.size > KEPT) this._chunks.delete(this._chunks.keys().next().value);
          this.changed();
        } catch (trouble) {
          this.trouble = trouble.message;
        } finally {
          this._asked.delete(chunk);
        }
      }
    }

    /* All data of a message: its fields, content and words. */
    async detail(message) {
      const details = await this.source.details(message >> 10, (message & 1023) + 1);
      return details[message & 1023];
    }
  };
})();
