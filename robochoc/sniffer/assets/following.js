"use strict";
/* Loads announced data, piece by piece, until the page is complete. If the run is faster than the page, the page shows
   how far it is behind; neither waits for the other. */
(() => {
  const PAUSE_MS = 15; // pause between pieces, in which frames are painted

  Sniffer.Following = class {
    constructor(model, source, handlers) {
      Object.assign(this, { model, source, handlers });
      this.goal = { messages: 0, steps: 0, decisions: 0 };
      this.gone = false;
      this.trouble = "";
    }

    get behind() {
      return Math.max(this.goal.messages - this.model.messageCount, 0);
    }

    /* Whether the run has ended and is completely loaded. */
    get whole() {
      const { model, goal } = this;
      return Boolean(model.about.over) && model.messageCount >= goal.messages && model.stepCount >= goal.steps;
    }

    /* `news`: the present numbers of `about`. */
    async news(news) {
      const { model } = this;
      if (news.generation !== undefined && news.generation !== model.about.generation) return this.handlers.anew();
      for (const name of ["messages", "steps", "decisions"]) this.goal[name] = Math.max(news[name] ?? 0, this.goal[name]);
      const { about } = model;
      const lists = { robots_count: "robots", kinds_count: "kinds", runs_count: "runs", notes_count: "notes" };
      this._stale = this._stale || Object.entries(lists).some(([count, list]) => news[count] !== undefined && news[count] !== about[list + "_told"]);
      for (const [count, list] of Object.entries(lists)) if (news[count] !== undefined) about[list + "_told"] = news[count];
      if (news.over !== undefined) this._stale = this._stale || news.over !== about.over;
      for (const name of ["over", "verdict", "damage", "unseen"]) if (news[name] !== undefined) about[name] = news[name];
      this.handlers.changed();
      return this.pull();
    }

    async pull() {
      if (this._pulling) return;
      this._pulling = true;
      try {
        while (await this._piece()) await new Promise((done) => setTimeout(done, PAUSE_MS));
        this.trouble = "";
      } catch (trouble) {
        this.trouble = trouble.message;
      } finally {
        this._pulling = false;
        this.handlers.changed();
      }
    }

    /* One round: messages, then steps that may refer to them, then decisions. Returns whether there was anything to load. */
    async _piece() {
      const { model, source, goal } = this;
      if (this._stale || model.outgrown) {
        this._stale = false;
        const about = await source.about();
        if (about.generation !== model.about.generation) return this.handlers.anew();
        for (const list of ["robots", "kinds", "runs", "notes"]) about[list + "_told"] = model.about[list + "_told"];
        model.update(about);
        this.handlers.about();
        for (const name of ["messages", "steps", "decisions"]) goal[name] = Math.max(about[name], goal[name]);
      }
      const upTo = (from, to) => Math.min(to, from + source.span);
      const before = [model.messageCount, model.stepCount, model.decisionCount];
      const target = { ...goal }; // later steps refer to messages that are not loaded yet
      if (before[0] < target.messages) {
        const to = upTo(before[0], target.messages);
        model.addMessages(await source.columns(before[0], to), to - before[0]);
      }
      if (before[1] < target.steps) {
        const to = upTo(before[1], target.steps);
        model.addSteps(await source.steps(before[1], to), to - before[1]);
      }
      if (before[2] < target.decisions) {
        const list = await source.decisions(before[2], upTo(before[2], target.decisions));
        const known = list.findIndex(([step]) => step >= model.stepCount);
        model.addDecisions(known < 0 ? list : list.slice(0, known));
      }
      const more = before[0] < model.messageCount || before[1] < model.stepCount || before[2] < model.decisionCount;
      model.whole = this.whole;
      if (more) this.handlers.grown();
      return more || Boolean(this._stale);
    }

    begin() {
      const { about } = this.model;
      for (const list of ["robots", "kinds", "runs", "notes"]) about[list + "_told"] = about[list + "_count"] ?? (about[list] || []).length;
      this.news(about);
      if (!about.over) this._listen();
    }

    _listen() {
      this.source.onNews((news) => this.news(news), (over) => {
        this.gone = !over;
        this.handlers.changed();
      });
    }
  };
})();
