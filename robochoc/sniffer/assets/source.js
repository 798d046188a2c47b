"use strict";
/* The sources of the page's data: a server on this machine, or the page itself (an exported file). */
(() => {
  const KEPT = 24; // the number of cached chunks of details, and of states

  /* The content of zlib's bytes (RFC 1950) if all blocks are stored without compression (RFC 1951, 3.2.4), otherwise
     null. There is no promise, so that a small page is drawn before its `load` event: browsers without a window take a
     screenshot then. */
  const stored = (bytes) => {
    const content = new Uint8Array(bytes.length);
    let [at, size, head] = [2, 0, 0]; // after zlib's header
    do {
      head = bytes[at];
      if (head & 6) return null;
      const length = bytes[at + 1] | bytes[at + 2] << 8;
      content.set(bytes.subarray(at + 5, at + 5 + length), size);
      at += 5 + length;
      size += length;
    } while (!(head & 1));
    return content.slice(0, size).buffer;
  };

  /* Caches the last answers, which are lists that may grow: an answer shorter than `least`, or a failed request, is
     requested again. */
  const remembering = (ask) => {
    const kept = new Map();
    const asked = (key) => {
      const answer = ask(key).catch((trouble) => (kept.delete(key), Promise.reject(trouble)));
      kept.set(key, answer);
      if (kept.size > KEPT) kept.delete(kept.keys().next().value);
      return answer;
    };
    return async (key, least) => {
      const old = kept.get(key);
      if (!old) return asked(key);
      kept.delete(key);
      kept.set(key, old); // most recently used last
      const list = await old;
      return list.length >= least || kept.get(key) !== old ? list : asked(key);
    };
  };

  class Answers {
    constructor() {
      const details = remembering((chunk) => this._details(chunk));
      const states = remembering((key) => this._states(...key.split(":").map(Number)));
      this.details = (chunk, least = 0) => details(chunk, least);
      this.states = (robot, chunk, least = 0) => states(`${robot}:${chunk}`, least);
    }
  }

  Sniffer.Served = class extends Answers {
    constructor(base = ".") {
      super();
      this.base = base;
      this.span = 1 << 16; // messages or steps of a request: 2 MB, so that the first picture is fast
    }

    async _get(what) {
      const answer = await fetch(`${this.base}/${what}`, { cache: "no-store" });
      if (answer.ok) return answer;
      const trouble = new Error((await answer.text()) || `the server has answered with status ${answer.status}`);
      trouble.early = answer.status === 503; // there is nothing yet: try again soon
      throw trouble;
    }

    async _json(what) {
      return (await this._get(what)).json();
    }

    async _bytes(what) {
      return (await this._get(what)).arrayBuffer();
    }

    about() { return this._json("about"); }
    columns(from, to) { return this._bytes(`columns?from=${from}&to=${to}`); }
    steps(from, to) { return this._bytes(`steps?from=${from}&to=${to}`); }
    decisions(from, to) { return this._json(`decisions?from=${from}&to=${to}`); }
    _details(chunk) { return this._json(`details?chunk=${chunk}`); }
    _states(robot, chunk) { return this._json(`states?robot=${robot}&chunk=${chunk}`); }
    scene(from = 0) { return this._json(`scene?from=${from}`); }

    /* The messages with the text `query` from number `from` on, up to the message `to` or as far as a short search gets. */
    search(query, from, to) { return this._json(`search?text=${encodeURIComponent(query)}&from=${from}&to=${to}`); }

    /* The address of the journal's file. */
    get journal() { return `${this.base}/journal`; }

    /* Calls `news(small fields of about)` during the run, and `gone()` when the server has ended. */
    onNews(news, gone) {
      const address = new URL(`${this.base}/news`, location.href);
      address.protocol = address.protocol.replace("http", "ws");
      const socket = new WebSocket(address);
      let over = false;
      socket.addEventListener("message", (event) => {
        const state = JSON.parse(event.data);
        over = state.over;
        news(state);
      });
      socket.addEventListener("close", () => gone(over));
    }
  };

  /* The same answers, as base64 of zlib's bytes, in `<script type="application/octet-stream" id="feed:...">`. */
  Sniffer.Embedded = class extends Answers {
    constructor() {
      super();
      this.span = Infinity; // columns are complete
    }

    static here() {
      return document.getElementById("feed:about") !== null;
    }

    async _bytes(name) {
      const element = document.getElementById("feed:" + name);
      if (!element) throw new Error("this page does not contain them");
      const packed = Uint8Array.from(atob(element.textContent.trim()), (sign) => sign.charCodeAt(0));
      const content = stored(packed);
      if (content) return content;
      const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
      return new Response(stream).arrayBuffer();
    }

    async _json(name) {
      return JSON.parse(new TextDecoder().decode(await this._bytes(name)));
    }

    about() { return this._json("about"); }
    columns() { return this._bytes("columns"); }
    steps() { return this._bytes("steps"); }
    decisions() { return this._json("decisions"); }
    _details(chunk) { return this._json(`details:${chunk}`); }
    _states(robot, chunk) { return this._json(`states:${robot}:${chunk}`); }
    scene() { return this._json("scene"); }

    /* As above; `isHit(message, detail)` decides. */
    async search(query, from, to, isHit) {
      const first = from - from % Sniffer.CHUNK;
      const hits = (await this.details(first / Sniffer.CHUNK)).map((detail, at) => (isHit(first + at, detail) ? first + at : -1));
      return { hits: hits.filter((message) => message >= from), to: Math.min(first + Sniffer.CHUNK, to) };
    }

    get journal() { return null; }
    onNews() {}
  };

  Sniffer.source = () => (Sniffer.Embedded.here() ? new Sniffer.Embedded() : new Sniffer.Served());
})();
