"use strict";
/* The list of robots: robots with a lifeline, groups with a common lifeline, and their order. */
(() => {
  Sniffer.RobotList = class {
    constructor(model, view, lanes, handlers) {
      Object.assign(this, { model, view, lanes, handlers });
      this.open = new Set(); // opened groups
      this.wanted = "";
      this.element = Sniffer.byId("robots");
      this._build();
    }

    _build() {
      const { make } = Sniffer;
      const button = (text, title, does) => make("button", { type: "button", title, onclick: does }, text);
      this.search = make("input", { type: "search", placeholder: "Robot2.*", "aria-label": "Find robots by name or pattern" });
      this.search.addEventListener("input", () => {
        this.wanted = this.search.value;
        this.paint();
      });
      this.tree = make("ul", { class: "tree" });
      this.these = button("Only these", "Lifelines for the robots found only", () => this._only(this._found()));
      this.neighbours = button("Only neighbours", "", () => this._neighbours());
      this.summary = make("p", { class: "soft" });
      this.group = make("button", { type: "button", onclick: () => this._group() }, "One lifeline for these");
      this.element.append(
        this.search,
        make("div", { class: "buttons" },
          button("All", "A lifeline for each robot", () => this._choose(this.view.order, true)),
          button("None", "Remove all lifelines", () => this._choose(this.view.order, false)),
          this.these,
          this.neighbours,
          this.group),
        this.summary,
        this.tree,
        make("div", { class: "buttons" },
          button("Collapse groups", "One lifeline for each row", () => this._collapse(true)),
          button("Expand groups", "One lifeline for each robot", () => this._collapse(false)),
          button("Reset", "Initial robots, groups and order", () => {
            this.search.value = this.wanted = "";
            this.handlers.begin();
            this.paint();
          })),
      );
    }

    _found() {
      const pattern = this.wanted.trim();
      if (!pattern) return [...this.view.order];
      const glob = Sniffer.matcher(pattern);
      const part = pattern.toLowerCase();
      return this.view.order.filter((robot) => {
        const name = this.model.nameOf(robot);
        return glob(name) || name.toLowerCase().includes(part);
      });
    }

    _choose(robots, wanted) {
      for (const robot of robots) wanted ? this.view.chosen.add(robot) : this.view.chosen.delete(robot);
      this.view.touch("chosen");
    }

    _only(robots) {
      this.view.set({ chosen: new Set(robots) });
    }

    _neighbours() {
      if (this.view.robot < 0) return Sniffer.say("Choose a robot first: click its name");
      return this._only(this.lanes.neighbours(this.view.robot));
    }

    _group() {
      const pattern = this.wanted.trim();
      if (!pattern || !this._found().length) return Sniffer.say("Enter a pattern first, such as Robot2.*");
      const name = this._found().every((robot) => Sniffer.matcher(pattern)(this.model.nameOf(robot))) ? pattern : `*${pattern}*`;
      if (!this.view.patterns.includes(name)) this.view.patterns.push(name);
      this.view.collapsed.add(name);
      this.view.touch("patterns", "collapsed");
      return undefined;
    }

    _collapse(wanted) {
      this.view.collapsed = new Set(wanted ? this.lanes.groups().filter((group) => group.name).map((group) => group.name) : []);
      if (!wanted) this.view.patterns = [];
      this.view.touch("collapsed", "patterns");
    }

    paint() {
      const { view, model } = this;
      const found = new Set(this._found());
      this.group.disabled = this.these.disabled = !this.wanted.trim();
      const whose = view.robot < 0 ? "" : model.nameOf(view.robot);
      this.neighbours.disabled = !whose;
      this.neighbours.textContent = whose ? `Only neighbours of ${whose}` : "Only neighbours";
      this.neighbours.title = whose ? `Lifelines for ${whose} and the robots that exchange messages with it` : "Choose a robot first: click its name";
      this.summary.textContent = `${Sniffer.count(view.chosen.size)} of ${Sniffer.many(model.robots.length, "robot")} chosen`
        + (this.wanted.trim() ? `, ${Sniffer.count(found.size)} found` : "");
      const held = document.activeElement && this.tree.contains(document.activeElement) ? document.activeElement.dataset.key : null;
      const entries = [];
      for (const group of this.lanes.groups()) {
        const robots = group.robots.filter((robot) => found.has(robot));
        if (!robots.length) continue;
        if (!group.name || group.robots.length === 1) entries.push(...robots.map((robot) => this._robot(robot)));
        else entries.push(this._groupEntry(group, robots));
      }
      Sniffer.fill(this.tree, ...entries);
      if (held) {
        const again = [...this.tree.querySelectorAll("[data-key]")].find((element) => element.dataset.key === held);
        if (again) again.focus({ preventScroll: true });
      }
    }

    _groupEntry({ name, robots: all }, robots) {
      const { make } = Sniffer;
      const { view } = this;
      const chosen = all.filter((robot) => view.chosen.has(robot)).length;
      const open = this.open.has(name) || Boolean(this.wanted.trim());
      const box = make("input", { type: "checkbox", checked: chosen === all.length, "data-key": `all ${name}`, "aria-label": `All of ${name}`,
        onchange: () => this._choose(robots, box.checked) });
      box.indeterminate = chosen > 0 && chosen < all.length;
      const one = view.collapsed.has(name);
      return make("li", {},
        make("div", { class: "entry" },
          make("button", { type: "button", class: "plain twist", "aria-expanded": String(open), "data-key": `open ${name}`,
            "aria-label": `Robots of ${name}`, onclick: () => {
              this.open.has(name) ? this.open.delete(name) : this.open.add(name);
              this.paint();
            } }, "▸"),
          box,
          make("span", { class: "name" }, name),
          make("small", {}, `${Sniffer.count(chosen)}/${Sniffer.count(all.length)}`),
          make("button", { type: "button", class: "plain tiny", "aria-pressed": String(one), "data-key": `one ${name}`,
            "aria-label": `One lifeline for ${name}`, title: one ? "They share one lifeline" : "One lifeline for all of them",
            onclick: () => {
              one ? view.collapsed.delete(name) : view.collapsed.add(name);
              view.touch("collapsed");
            } }, one ? "⊟" : "⊞")),
        open ? make("ul", {}, ...robots.map((robot) => this._robot(robot))) : null);
    }

    _robot(robot) {
      const { make } = Sniffer;
      const { view, model } = this;
      const name = model.nameOf(robot);
      const box = make("input", { type: "checkbox", checked: view.chosen.has(robot), "aria-label": `Lifeline of ${name}`,
        "data-key": `box ${name}`, onchange: () => this._choose([robot], box.checked) });
      return make("li", { class: view.robot === robot ? "entry chosen" : "entry" },
        box,
        make("button", { type: "button", class: "plain name", "data-key": `name ${name}`, "aria-pressed": String(view.robot === robot),
          onclick: () => this.handlers.robot(robot),
          onkeydown: (event) => this._move(event, robot) }, name),
        make("small", {}, model.valueAt(robot, view.moment)));
    }

    /* Alt with the up or down key moves a robot among the lifelines. */
    _move(event, robot) {
      const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
      if (!step || !event.altKey) return;
      event.preventDefault();
      event.stopPropagation();
      const { order } = this.view;
      const at = order.indexOf(robot);
      const to = at + step;
      if (to < 0 || to >= order.length) return;
      [order[at], order[to]] = [order[to], order[at]];
      this.view.touch("order");
      Sniffer.say(`${this.model.nameOf(robot)} is now number ${to + 1}`);
    }
  };
})();
