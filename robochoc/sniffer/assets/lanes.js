"use strict";
/* The lifelines: one for each chosen robot, one for each collapsed group, and one for all other robots. */
(() => {
  const natural = new Intl.Collator("en", { numeric: true });
  const ROW = /^(.*\d)\.\d+$/; // Robot3.1 belongs to row Robot3

  /* A pattern with * and ?, or several with commas between, as a test of names. Empty: any name. */
  Sniffer.matcher = (patterns) => {
    const parts = patterns.split(",").map((part) => part.trim()).filter(Boolean);
    if (!parts.length) return () => true;
    const expressions = parts.map((part) => {
      const literal = part.replace(/[.+^$(){}|[\]\\]/g, "\\$&").replace(/\*+/g, ".*").replace(/\?/g, ".");
      return new RegExp(`^${literal}$`, "i");
    });
    return (name) => expressions.some((expression) => expression.test(name));
  };

  Sniffer.Lanes = class {
    constructor(model, view) {
      this.model = model;
      this.view = view;
      this.arrange();
    }

    /* Sets the robots in their natural order, and chooses those in `about.chosen`; all if it is empty. */
    begin() {
      const { model, view } = this;
      const robots = model.robots.map((_, robot) => robot);
      view.order = [...robots].sort((one, other) => natural.compare(model.nameOf(one), model.nameOf(other)));
      const wanted = model.about.chosen || [];
      const isWanted = Sniffer.matcher(wanted.join(","));
      view.chosen = new Set(robots.filter((robot) => !wanted.length || isWanted(model.nameOf(robot))));
      if (!view.chosen.size) view.chosen = new Set(robots);
      view.collapsed = new Set();
      if (view.chosen.size > 40) for (const group of this.groups()) if (group.robots.length > 1) view.collapsed.add(group.name);
      this.arrange();
    }

    /* Adds new robots, which are chosen in the same way as the first ones. */
    welcome() {
      const known = new Set(this.view.order);
      const wanted = this.model.about.chosen || [];
      const isWanted = Sniffer.matcher(wanted.join(","));
      for (let robot = 0; robot < this.model.robots.length; robot++)
        if (!known.has(robot)) {
          this.view.order.push(robot);
          if (!wanted.length || isWanted(this.model.nameOf(robot))) this.view.chosen.add(robot);
        }
      this.arrange();
    }

    groupOf(robot) {
      const name = this.model.nameOf(robot);
      for (const pattern of this.view.patterns) if (Sniffer.matcher(pattern)(name)) return pattern;
      const row = ROW.exec(name);
      return row ? row[1] + ".*" : "";
    }

    groups() {
      const groups = new Map();
      for (const robot of this.view.order) {
        const name = this.groupOf(robot);
        if (!groups.has(name)) groups.set(name, { name, robots: [] });
        groups.get(name).robots.push(robot);
      }
      return [...groups.values()];
    }

    arrange() {
      const { view, model } = this;
      const lanes = [];
      const shared = new Map();
      const others = [];
      for (const robot of view.order) {
        if (!view.chosen.has(robot)) {
          others.push(robot);
          continue;
        }
        const group = this.groupOf(robot);
        if (!group || !view.collapsed.has(group)) lanes.push({ name: model.nameOf(robot), robots: [robot], group: null });
        else if (shared.has(group)) shared.get(group).robots.push(robot);
        else {
          const lane = { name: group, robots: [robot], group };
          shared.set(group, lane);
          lanes.push(lane);
        }
      }
      this.others = others.length ? lanes.length : -1;
      if (others.length) lanes.push({ name: "others", robots: others, group: null, others: true });
      this.list = lanes;
      this.of = new Int32Array(Math.max(model.ownSteps.length, view.order.length)).fill(Math.max(this.others, 0));
      lanes.forEach((lane, at) => lane.robots.forEach((robot) => (this.of[robot] = at)));
    }

    /* Moves the robots of a lifeline before those of another one; after the last lifeline, to the end. */
    move(from, to) {
      const { view } = this;
      const moving = new Set(this.list[from].robots);
      const before = to < this.list.length ? this.list[to].robots.find((robot) => !moving.has(robot)) : undefined;
      const rest = view.order.filter((robot) => !moving.has(robot));
      const at = before === undefined ? rest.length : rest.indexOf(before);
      rest.splice(at, 0, ...view.order.filter((robot) => moving.has(robot)));
      view.order = rest;
      view.touch("order");
    }

    /* `robot`, and all robots that have exchanged messages with it. */
    neighbours(robot) {
      const { sender, receiver } = this.model.messages;
      const found = new Set([robot]);
      for (let m = 0; m < this.model.messageCount; m++) {
        if (sender[m] === robot) found.add(receiver[m]);
        else if (receiver[m] === robot) found.add(sender[m]);
      }
      return found;
    }
  };
})();
