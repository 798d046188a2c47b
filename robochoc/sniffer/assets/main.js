"use strict";
/* Connects the parts: user actions change the view, news change the model, and each frame shows both. */
(() => {
  const { byId } = Sniffer;
  const FILTERS = ["chosen", "off", "senders", "receivers", "run", "from", "to", "concern", "about", "hitsOnly"];
  const LANES = ["chosen", "order", "collapsed", "patterns"];
  const has = (changed, names) => names.some((name) => changed.has(name));

  class Page {
    constructor(source, about) {
      this.source = source;
      this.model = new Sniffer.Model(about);
      this.view = new Sniffer.View();
      const { model, view } = this;
      this.windows = Sniffer.frame(() => this.repaint());
      if (innerWidth <= 600) view.layout = "table";
      view.follow = Boolean(about.live && !about.over);
      this.lanes = new Sniffer.Lanes(model, view);
      this.lanes.begin();
      this.texts = new Sniffer.Texts(model, source, () => this.list.draw());
      this.search = new Sniffer.Search(model, source, (found) => this.searched(found));
      this.filter = new Sniffer.Filter(model, view, this.search);
      this.saving = new Sniffer.Saving(model, this.filter, this.texts, source);
      this.time = new Sniffer.Time(model, view);
      const handlers = { message: (m) => this.message(m), step: (step) => this.time.go(step), robot: (robot) => this.robot(robot),
        words: (m) => this.texts.words(m), has: (chunk) => this.texts.has(chunk), ask: (chunks) => this.texts.ask(chunks),
        begin: () => this.again() };
      this.chart = new Sniffer.Chart(model, view, this.lanes, this.filter, { ...handlers, scrolled: () => this.sight.scrolled(this.chart) });
      this.list = new Sniffer.List(model, view, this.filter, source, { ...handlers, scrolled: () => this.sight.scrolled(this.list), message: (m) => {
        this.message(m);
        if (this.windows.narrow()) this.windows.right(true); // there is no room next to the table
      } });
      this.robots = new Sniffer.RobotList(model, view, this.lanes, handlers);
      this.filters = new Sniffer.FilterPane(model, view, this.filter);
      this.detail = new Sniffer.Detail(model, view, source, this.texts, this.saving, handlers);
      this.state = new Sniffer.StatePane(model, view, source, handlers);
      this.following = new Sniffer.Following(model, source, {
        grown: () => this.grown(), changed: () => this.status(), about: () => this.met(), anew: () => this.anew() });
      this.notices = new Sniffer.Notices(model, this.following, handlers);
      this.address = new Sniffer.Address(model, view, () => this.time.touched);
      this.sight = new Sniffer.Sight(this);
      this.legend = new Sniffer.Legend(model, view);
      this.address.begin();
      this.wanted = this.address.read();
      Sniffer.controls(this);
      this.slowly = Sniffer.seldom(80, () => this.robots.paint());
      view.on((changed) => this.changed(changed));
      this.lanes.arrange();
      this._facts();
      this._arrange();
      byId("query").value = view.query;
      this.filter.rebuild();
      this.repaint();
      this.following.begin();
    }

    // User actions

    message(m) {
      if (m < 0 || m >= this.model.messageCount) return;
      this.view.set({ selected: m, upper: "message", follow: false });
      if (this.view.robot < 0) this.view.set({ robot: this.model.messages.sender[m] });
      this.time.go(this.model.messages.step[m]);
      if (!this.filter.shows(m)) Sniffer.say("The filters leave this message out of the chart");
    }

    robot(robot) {
      this.view.set({ robot, upper: "robot" });
    }

    /* Goes to the step that decided the run: the robot's conclusion, else the last change of a value. */
    decided() {
      const { model, time, view } = this;
      const step = model.deciding >= 0 ? model.deciding : Math.max(-1, ...model.decided.map((one) => (one.step.length ? one.step.all[one.step.length - 1] : -1)));
      if (step < 0 || step >= model.stepCount) return Sniffer.say("This step is not known");
      const packet = model.packetOf(step);
      if (packet.length) this.message(packet[packet.length - 1]);
      view.set({ robot: model.steps.robot[step], upper: packet.length ? "message" : "robot" });
      return time.go(step);
    }

    move(rows) {
      const { filter, view } = this;
      if (!filter.length) return;
      const from = view.selected < 0 ? Math.floor(view.top) - Math.sign(rows) : filter.rowOf(view.selected);
      const off = view.selected >= 0 && rows > 0 && !filter.shows(view.selected) ? 1 : 0;
      this.message(filter.at(Math.min(Math.max(from + rows - off, 0), filter.length - 1)));
      byId("grid").focus({ preventScroll: true });
    }

    /* Goes to the next hit of the search text (previous: `step` -1); for a new text, to the first hit. */
    hit(step) {
      const { view, search } = this;
      const query = byId("query").value;
      if (query !== view.query) {
        view.set({ query });
        search.find(query);
      }
      if (!search.query) return Sniffer.say("Enter a text to search for");
      const anew = this.visited !== search.query;
      const from = view.selected >= 0 && !anew ? view.selected : step > 0 ? -1 : Infinity;
      const found = search.running && step < 0 ? -1 : search.next(from, step, (m) => this.filter.shows(m));
      this.awaited = found < 0 && search.running ? step : 0;
      if (found < 0) return Sniffer.say(search.running ? "Still searching" : "No hit among the messages shown");
      this.visited = search.query;
      return this.message(found);
    }

    again() {
      const { view } = this;
      view.patterns = [];
      this.lanes.begin();
      view.touch("order", "chosen", "collapsed", "patterns");
    }

    cause(list) {
      const { view } = this;
      if (view.selected < 0 || view.selected >= this.model.messageCount) return;
      const [first] = list(view.selected);
      if (first === undefined) Sniffer.say("There is none in this direction");
      else this.message(first);
    }

    // Display

    changed(changed) {
      const { view, model } = this;
      if ([...changed].every((name) => name === "top" || name === "left")) { // scrolling is the most frequent change, and the smallest
        this.chart.draw();
        this.address.save();
        return;
      }
      if (has(changed, [...LANES, ...FILTERS])) this._refilter(has(changed, LANES));
      if (changed.has("query")) this.search.find(view.query);
      if (changed.has("layout")) this._arrange();
      if (changed.has("upper")) this.showUpper(view.upper);
      if (changed.has("lower")) this.showLower(view.lower);
      if (has(changed, ["colourBy"])) this.chart.minimap.refresh();
      if (changed.has("colourBy")) this.legend.paint();
      if (view.follow && changed.has("follow")) this._newest();
      if (changed.has("moment") || changed.has("selected")) this.sight.reveal(changed);
      if (has(changed, ["robot", "moment", ...LANES])) this.slowly();
      if (changed.has("moment") && model.stepCount) this._showMoment();
      if (changed.has("robot") && view.robot < 0) view.set({ whose: "all" });
      this.filters.paint();
      this.detail.paint();
      this.state.paint();
      this.time.paint();
      this.status();
      this.chart.draw();
      this.list.draw();
      this.address.save();
    }

    repaint() {
      if (!this.chart) return;
      this.chart.minimap.refresh();
      this.chart.draw();
      this.list.draw();
      for (const part of [this.filters, this.robots, this.detail, this.state, this.time]) part.paint();
      this.legend.paint();
      this.status();
    }

    /* After a change of rows or lifelines, the present message remains at its position in the window. */
    _refilter(lanes = false) {
      const { filter, view } = this;
      const held = this.sight.held();
      if (lanes) this.lanes.arrange();
      filter.rebuild();
      this.sight.hold(held);
      this.chart.minimap.refresh();
      Sniffer.say(`${Sniffer.count(filter.length)} of ${Sniffer.many(this.model.messageCount, "message")} shown`, true);
    }

    _showMoment() {
      if (this.counters) this.counters.show(this.view.moment);
      if (this.scene) this.scene.show(this.view.moment);
    }

    _newest() {
      this.time.touched = false;
      this.view.set({ top: this.chart.shape.lowest, moment: Math.max(this.model.stepCount - 1, 0) });
      this.list.top = this.filter.length;
    }

    _arrange() {
      const { layout } = this.view;
      byId("centre").dataset.layout = layout;
      for (const input of document.querySelectorAll("[name=layout]")) input.checked = input.value === layout;
      byId("colour").value = this.view.colourBy;
      byId("arrows").value = this.view.arrows;
      this.chart.measure();
      this.sight.align();
      this.chart.draw();
      this.list.draw();
    }

    _facts() {
      const { about } = this.model;
      document.title = `${about.title} · sniffer`;
      byId("title").textContent = about.title;
      const facts = [Sniffer.many(about.robots.length, "robot"), about.runtime, about.seed === undefined ? "" : `seed ${about.seed}`,
        about.order ? `order ${about.order}` : "", about.channel ? `channel ${about.channel}` : ""];
      byId("facts").textContent = facts.filter(Boolean).join(" · ");
    }

    // News

    grown() {
      const { view, model, filter } = this;
      filter.extend();
      if (view.follow) this._newest();
      this._restore();
      if (!this.begun && model.messageCount) { // words for the first picture
        this.begun = true;
        this.texts.ask([Math.max(view.selected, 0) >> 10]);
      }
      if (this.counters) this.counters.update();
      else if (model.stepCount) this.showLower(view.lower);
      this._growScene();
      this.chart.minimap.refresh();
      if (view.query && !this.search.running) this.slowSearch();
      this.changed(new Set(["grown"]));
      this.slowly();
    }

    /* Applies the positions of the address when these parts are loaded. */
    _restore() {
      const { wanted, model, view, filter, chart } = this;
      const whole = model.messageCount >= this.following.goal.messages;
      if (wanted.selected !== undefined && wanted.selected < model.messageCount) {
        const selected = Math.max(Math.floor(wanted.selected), 0);
        if (wanted.top === undefined) view.set({ selected }); // scrolls to the message
        else view.selected = selected;
        this.list.reveal(filter.rowOf(view.selected));
        if (view.robot < 0) view.set({ robot: model.messages.sender[view.selected] });
        if (wanted.withoutMoment) {
          view.set({ follow: false });
          wanted.moment = model.messages.step[view.selected];
        }
        wanted.selected = undefined;
      }
      if (wanted.moment !== undefined && wanted.moment < model.stepCount) {
        this.time.touched = true;
        view.set({ moment: Math.max(Math.floor(wanted.moment), 0) });
        wanted.moment = undefined;
      }
      if (wanted.top !== undefined && (whole || filter.length > wanted.top + 200)) {
        view.set({ top: wanted.top });
        chart.shape.clamp();
        if (view.selected < 0) this.sight.scrolled(chart);
        wanted.top = undefined;
      }
    }

    met() {
      this.lanes.welcome();
      this._facts();
      this.filter.rebuild();
      this.robots.paint();
      this.legend.paint();
    }

    /* The numbering has changed: loads everything again, with the same view. */
    anew() {
      this.ordering = true;
      this.status();
      if (this.view.follow) this.time.touched = true; // a user who has followed the run to its end is at the end again
      this.address._save();
      location.reload();
      return false;
    }

    searched(found) {
      const { search, view, model } = this;
      this.chart.drawing.marks = this.list.marks = search.query ? search.marks : null;
      this.chart.minimap.hits = search.hits;
      const part = search.running ? ` · ${Math.floor((search.looked / Math.max(model.messageCount, 1)) * 100)} %` : "";
      const at = search.hits.length && search.marks.has(view.selected) ? `${Sniffer.count(Sniffer.lowerBound(search.hits, view.selected) + 1)} of ` : "";
      byId("hits").textContent = search.trouble || (search.query ? `${at}${Sniffer.count(search.hits.length)}${part}` : "");
      if (view.hitsOnly && (found || !search.query)) this._refilter();
      if (search.query && !search.running) Sniffer.say(Sniffer.many(search.hits.length, "hit"), true);
      if (this.awaited) this.hit(this.awaited);
      this.chart.draw();
      this.list.draw();
    }

    status() {
      const { model, filter, following, view } = this;
      const { about } = model;
      const { count } = Sniffer;
      model.whole = following.whole;
      const shown = filter.length === model.messageCount ? Sniffer.many(model.messageCount, "message")
        : `${count(filter.length)} of ${Sniffer.many(model.messageCount, "message")}`;
      const late = following.behind > 0 && !following.gone ? ` · ${Sniffer.many(following.behind, "message")} not drawn yet` : "";
      byId("counts").textContent = shown + late;
      const verdict = byId("verdict");
      const said = this.ordering || about.ordering ? "The journal is being sorted."
        : following.gone && !about.over ? "The end of the run is not known." : about.verdict || "";
      verdict.hidden = !said;
      if (verdict.textContent !== said) verdict.textContent = said;
      verdict.dataset.over = String(Boolean(about.over || following.gone));
      verdict.disabled = !about.over || model.deciding < 0 && !model.decisionCount;
      verdict.title = verdict.disabled ? said : `${said}\nClick to see the step that decided it`;
      const live = byId("live");
      live.hidden = about.over || following.gone;
      live.setAttribute("aria-pressed", String(view.follow));
      live.textContent = view.follow ? "Following" : "Follow";
      live.title = view.follow ? "New messages are shown when they arrive (f)" : "Show the newest messages (f)";
      const nothing = byId("nothing");
      nothing.hidden = filter.length > 0 || !(following.whole || model.messageCount || (about.live && !about.messages));
      nothing.textContent = model.messageCount ? "No message matches the filters and the chosen robots."
        : about.over ? "No message was sent." : following.gone ? "" : "Waiting for the robots";
      if (this.search.query) this.searchedQuietly();
      this.notices.paint();
    }

    searchedQuietly() {
      const { search, view } = this;
      if (!search.running && search.marks.has(view.selected))
        byId("hits").textContent = `${Sniffer.count(Sniffer.lowerBound(search.hits, view.selected) + 1)} of ${Sniffer.count(search.hits.length)}`;
    }

    // Controls

    async showLower(id) {
      const element = byId(id);
      if (id === "counters" && !this.counters && Sniffer.counters && this.model.stepCount) {
        this.counters = Sniffer.counters(element, this.model);
        this.counters.update();
        this._showMoment();
      }
      if (id !== "scene" || this.scene !== undefined || !Sniffer.scene) return;
      this.scene = null;
      try {
        const scene = await this.source.scene();
        this.sceneUpTo = scene ? scene.decisions : 0;
        if (scene) this.scene = Sniffer.scene(element, scene);
        else Sniffer.fill(element, Sniffer.make("p", { class: "hint" }, "There is no scene for this team's problem."));
        this._showMoment();
      } catch (trouble) {
        Sniffer.fill(element, Sniffer.make("p", { class: "hint" }, `The scene cannot be shown: ${trouble.message}`));
      }
    }

    /* Loads new decisions for the scene if it is visible; one request at a time. */
    async _growScene() {
      if (!this.scene || !this.scene.add || this._askingScene || !(this.sceneUpTo < this.model.decisionCount) || byId("scene").hidden) return;
      this._askingScene = true;
      try {
        const scene = await this.source.scene(this.sceneUpTo);
        this.sceneUpTo = scene ? scene.decisions : Infinity;
        this.scene.add(scene);
      } catch {
        /* the scene remains unchanged; the end of the server is shown elsewhere */
      }
      this._askingScene = false;
    }
  }

  /* Loads the description of the run. A live page may be open before the robots start: it repeats the request. */
  const met = async (source) => {
    for (;;) {
      try {
        return await source.about();
      } catch (trouble) {
        if (!trouble.early) throw trouble;
        await new Promise((done) => setTimeout(done, 300));
      }
    }
  };

  const begin = async () => {
    const source = Sniffer.source();
    Sniffer.palette.apply();
    // ?driven: the surrounding page has the time line, so this page shows none.
    if (new URLSearchParams(location.search).has("driven")) document.documentElement.dataset.driven = "";
    const waiting = setTimeout(() => {
      byId("nothing").hidden = false;
      byId("nothing").textContent = "Waiting for the robots";
    }, 150);
    try {
      const about = await met(source);
      clearTimeout(waiting);
      byId("nothing").hidden = true;
      Sniffer.page = new Page(source, about);
    } catch (trouble) {
      clearTimeout(waiting);
      byId("nothing").hidden = true;
      Sniffer.fill(byId("notices"), Sniffer.make("p", { class: "notice" }, `The run cannot be shown: ${trouble.message}`));
    }
  };
  begin();
})();
