"use strict";
/* The boxes over the lifelines: the robot's name and present value. They can be clicked, dragged, and moved by keys. */
(() => {
  Sniffer.Heads = class {
    constructor(model, view, lanes, shape, handlers) {
      Object.assign(this, { model, view, lanes, shape, handlers });
      this.element = Sniffer.byId("heads");
      this.pool = [];
      this.element.addEventListener("pointerdown", (event) => this._grab(event));
      this.element.addEventListener("click", (event) => this._press(event));
      this.element.addEventListener("keydown", (event) => this._key(event));
    }

    /* Only the boxes in the window exist; each keeps its button while it is there. */
    place() {
      const { shape, lanes, element } = this;
      const width = shape.laneWidth;
      const from = Math.max(Math.floor((this.view.left - width) / width), 0);
      const to = Math.min(Math.ceil((this.view.left + shape.width) / width), lanes.list.length);
      while (this.pool.length < to - from) {
        const head = Sniffer.make("button", { type: "button", class: "head" }, Sniffer.make("b"), Sniffer.make("span"));
        this.pool.push(head);
        element.append(head);
      }
      this.pool.forEach((head, at) => {
        head.hidden = from + at >= to;
        if (!head.hidden) this._fill(head, from + at, width);
      });
    }

    _fill(head, at, width) {
      const lane = this.lanes.list[at];
      const { model, view } = this;
      const single = lane.robots.length === 1 && !lane.others;
      const value = single ? model.valueAt(lane.robots[0], view.moment) : Sniffer.many(lane.robots.length, "robot");
      const short = this._short(value, single ? 0 : lane.robots.length, width);
      const style = `translateX(${Math.round(this.shape.x(at) - width / 2)}px)`;
      if (head.style.transform !== style) head.style.transform = style;
      const wide = `${Math.max(width - 4, 12)}px`;
      if (head.style.width !== wide) head.style.width = wide;
      const chosen = String(single && lane.robots[0] === view.robot);
      const { sender, receiver } = model.messages;
      const m = view.selected < model.messageCount ? view.selected : -1;
      const party = m >= 0 && !lane.others && (lane.robots.includes(sender[m]) || lane.robots.includes(receiver[m]));
      const slim = width < 34;
      const witness = single && model.concluded.has(lane.robots[0]);
      const key = `${at}|${lane.name}|${short}|${chosen}|${party}|${slim}|${width < 84}|${witness}`;
      if (head.dataset.shown === key) return;
      head.dataset.shown = key;
      head.dataset.lane = at;
      head.className = lane.others ? "head others" : lane.group ? "head many" : "head";
      head.classList.toggle("party", party);
      head.classList.toggle("slim", slim);
      head.classList.toggle("found", witness);
      head.firstChild.textContent = width < 84 ? lane.name.slice(lane.others ? 0 : this._common()) : lane.name;
      head.lastChild.textContent = short || "–";
      head.setAttribute("aria-pressed", chosen);
      const does = lane.group ? "opens the group" : lane.others ? "not chosen" : "shows the robot";
      const found = witness ? `; ${model.concluded.get(lane.robots[0]).text}` : "";
      head.setAttribute("aria-label", `${lane.name}: ${value || "no value"}${found}; ${does}`);
      head.title = `${lane.name}\n${value || "no value"}${found.replace("; ", "\n")}\nDrag it, or press Alt and an arrow, to move it`;
    }

    /* The part of a value, or of the number of robots, that fits in a box of this width. */
    _short(value, shared, width) {
      if (shared) return width < 84 ? Sniffer.count(shared) : value;
      if (width >= 96) return value;
      if (value === "no value") return "–";
      return value.replace(/^[^,]* = ([^,]*)$/, width < 34 ? "$1" : "= $1");
    }

    /* The length of the common prefix of all names before a number, which narrow boxes leave out. */
    _common() {
      const { robots } = this.model;
      if (this._of === robots) return this._letters;
      this._of = robots;
      const [first = ""] = robots;
      const word = (/^\p{L}*/u.exec(first) || [""])[0];
      this._letters = robots.every((name) => name.startsWith(word) && /^\d/.test(name.slice(word.length))) ? word.length : 0;
      return this._letters;
    }

    _laneOf(event) {
      const head = event.target.closest(".head");
      return head ? Number(head.dataset.lane) : -1;
    }

    _press(event) {
      const lane = this.lanes.list[this._laneOf(event)];
      if (!lane || this._dragged) return;
      if (lane.group) {
        this.view.collapsed.delete(lane.group);
        this.view.touch("collapsed");
      } else if (!lane.others) this.handlers.robot(lane.robots[0]);
    }

    _key(event) {
      const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
      const at = this._laneOf(event);
      if (!step || at < 0) return;
      event.preventDefault();
      event.stopPropagation();
      const last = this.lanes.list.length - (this.lanes.others < 0 ? 1 : 2);
      const to = at + step;
      if (to < 0 || to > this.lanes.list.length - 1) return;
      if (event.altKey) {
        if (at > last || to > last) return;
        const { name } = this.lanes.list[at];
        this.lanes.move(at, step > 0 ? at + 2 : at - 1);
        this._focus = to;
        Sniffer.say(`${name} is now lifeline ${to + 1}`);
      } else this._focusOn(to);
      requestAnimationFrame(() => requestAnimationFrame(() => this._focusOn(to)));
    }

    _focusOn(lane) {
      const x = this.shape.x(lane);
      if (x < 40 || x > this.shape.width - 40) this.view.set({ left: Math.max(this.view.left + x - this.shape.width / 2, 0) });
      const head = this.pool.find((one) => !one.hidden && Number(one.dataset.lane) === lane);
      if (head) head.focus({ preventScroll: true });
    }

    _grab(event) {
      const from = this._laneOf(event);
      this._dragged = false;
      if (from < 0 || event.button || from === this.lanes.others) return;
      const head = event.target.closest(".head");
      const begin = event.clientX;
      const left = this.element.getBoundingClientRect().left;
      const move = (now) => {
        if (!this._dragged && Math.abs(now.clientX - begin) < 6) return;
        this._dragged = true;
        head.classList.add("held");
        head.style.translate = `${now.clientX - begin}px 0`;
      };
      const end = (now) => {
        removeEventListener("pointermove", move);
        head.classList.remove("held");
        head.style.translate = "";
        if (!this._dragged) return;
        setTimeout(() => (this._dragged = false)); // ignore the following click
        const place = (now.clientX - left + this.view.left - this.shape.start) / this.shape.laneWidth;
        const to = Math.min(Math.max(Math.round(place), 0), this.lanes.list.length);
        if (to !== from && to !== from + 1) this.lanes.move(from, to);
      };
      addEventListener("pointermove", move);
      addEventListener("pointerup", end, { once: true });
    }
  };
})();
