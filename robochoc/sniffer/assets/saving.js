"use strict";
/* Saving of a message, the messages between two robots, or all shown messages, as ACL text or JSON. */
(() => {
  const nameOfFile = (text) => text.replace(/[^A-Za-z0-9._-]+/g, "-").slice(0, 80) || "run";

  const download = (parts, type, name) => {
    const address = URL.createObjectURL(new Blob(parts, { type }));
    Sniffer.make("a", { href: address, download: name }).click();
    setTimeout(() => URL.revokeObjectURL(address), 60_000);
  };

  Sniffer.Saving = class {
    constructor(model, filter, texts, source) {
      Object.assign(this, { model, filter, texts, source });
      this.journal = source.journal;
    }

    /* All data of a message as JSON, with the same numbers as in the CSV table of `robochoc journal`. */
    entry(m, detail) {
      const { model } = this;
      const { sender, receiver, t, step, bytes, clock, run } = model.messages;
      const taken = model.receivedStep[m];
      const kind = model.kindOf(m);
      return { number: m, t: t[m], sender: model.nameOf(sender[m]), receiver: model.nameOf(receiver[m]), type: kind.name,
        performative: kind.performative, run: run[m] + 1, step: step[m], taken_in: taken === Sniffer.NONE ? null : taken,
        clock: clock[m], bytes: bytes[m], words: detail.words, content: detail.content, acl: detail.fields };
    }

    scopes(m) {
      const { model, filter } = this;
      const { sender, receiver, run } = model.messages;
      const [one, other] = [sender[m], receiver[m]];
      return {
        message: { name: `message-${m}`, every: () => [m] },
        pair: { name: `${model.nameOf(one)}-${model.nameOf(other)}`, every: () => {
          const found = [];
          for (let i = 0; i < model.messageCount; i++)
            if (run[i] === run[m] && ((sender[i] === one && receiver[i] === other) || (sender[i] === other && receiver[i] === one))) found.push(i);
          return found;
        } },
        shown: { name: "shown", every: () => Array.from({ length: filter.length }, (_, row) => filter.at(row)) },
      };
    }

    async save(m, scope, format, report) {
      const { name, every } = this.scopes(m)[scope];
      const messages = every();
      const parts = [];
      let text = "";
      for (let i = 0; i < messages.length; i++) {
        const detail = await this.texts.detail(messages[i]);
        if (format === "acl") text += `${detail.acl}\n`;
        else if (scope === "message") text += `${JSON.stringify(this.entry(messages[i], detail), null, 2)}\n`;
        else text += `${i ? ",\n" : "[\n"}${JSON.stringify(this.entry(messages[i], detail))}`;
        if (text.length < 1 << 20) continue;
        parts.push(text);
        text = "";
        report(`${Sniffer.count(i + 1)} of ${Sniffer.many(messages.length, "message")}`);
      }
      if (format === "json" && scope !== "message") text += messages.length ? "\n]\n" : "[]\n";
      parts.push(text);
      download(parts, "text/plain;charset=utf-8", nameOfFile(`${this.model.about.team}-${name}.${format}`));
      report(`Saved ${Sniffer.many(messages.length, "message")}`);
    }

    panel(m) {
      const { make } = Sniffer;
      const { sender, receiver } = this.model.messages;
      const scope = make("select", { "aria-label": "Messages to save" },
        make("option", { value: "message" }, "this message"),
        make("option", { value: "pair" }, `${this.model.nameOf(sender[m])} with ${this.model.nameOf(receiver[m])}`),
        make("option", { value: "shown" }, "all shown messages"));
      const news = make("span", { class: "soft", role: "status" });
      const button = (format, text) => make("button", { type: "button", onclick: () => {
        this.save(m, scope.value, format, (text) => (news.textContent = text))
          .catch((trouble) => (news.textContent = `Saving failed: ${trouble.message}`));
      } }, text);
      return make("section", {},
        make("h3", {}, "Save"),
        make("div", { class: "buttons" }, scope, button("acl", "ACL text"), button("json", "JSON"),
          this.journal ? make("a", { class: "button", href: this.journal, download: "" }, "Complete journal") : null),
        news);
    }
  };
})();
