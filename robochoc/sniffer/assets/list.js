"use strict";
/* The messages as a table with the same rows as the chart, for reading and for screen readers. Only the rows in the
   window exist; `aria-rowindex` has their numbers. */
(() => {
  const NARROW = 560; // pixels: in a narrower table, the words are below the names
  const MOST = 8_000_000; // pixels: browsers do not draw much taller elements
  const PAUSE_MS = 120; // words are loaded at once, but not for each row during scrolling
  const COLUMNS = [["#", "number"], ["Time", "time"], ["From", "from"], ["To", "to"], ["Type", "type"], ["In words", "says"]];

  Sniffer.List = class {
    constructor(model, view, filter, source, handlers) {
      Object.assign(this, { model, view, filter, source, handlers });
      this.grid = Sniffer.byId("grid");
      this.table = Sniffer.byId("table");
      this.rows = [];
      this.said = new Map(); // chunk -> its details, for chunks in the window
      this._askedAt = -Infinity;
      this._placed = 0; // the position set by the page; any other position was set by the user
      this._build();
    }

    _build() {
      const { grid } = this;
      const heads = COLUMNS.map(([text, name], at) =>
        Sniffer.make("span", { role: "columnheader", class: name, "aria-colindex": String(at + 1) }, text));
      this.header = Sniffer.make("div", { role: "row", class: "row header", "aria-rowindex": "1" }, ...heads);
      this.spacer = Sniffer.make("div", { role: "presentation", class: "spacer" });
      grid.append(this.header, this.spacer);
      grid.setAttribute("aria-colcount", String(COLUMNS.length));
      grid.addEventListener("scroll", () => {
        this.draw();
        const byUser = Math.abs(grid.scrollTop - this._placed) >= 1;
        this._placed = grid.scrollTop;
        if (byUser) this.handlers.scrolled();
      });
      grid.addEventListener("wheel", (event) => this._wheel(event), { passive: false });
      grid.addEventListener("click", (event) => {
        const row = event.target.closest(".row[data-message]");
        if (row) this.handlers.message(Number(row.dataset.message));
      });
      new ResizeObserver(() => this._measure()).observe(grid);
    }

    /* After a change of the width, the top row remains, although the row height may differ. */
    _measure() {
      const { grid } = this;
      if (grid.clientWidth < 10) return; // the table is hidden
      const row = this.top;
      const narrow = grid.clientWidth < NARROW;
      if (narrow !== Boolean(this.narrow)) {
        this.narrow = narrow;
        grid.classList.toggle("narrow", narrow);
        this.top = row;
      }
      this.draw();
    }

    get tall() {
      return this.narrow ? 48 : 28;
    }

    get inWindow() {
      return Math.max(Math.floor((this.grid.clientHeight - this.tall) / this.tall), 1);
    }

    /* If the table is taller than browsers can draw, a pixel of its scrollbar means more than one pixel. */
    get scale() {
      const room = this.grid.clientHeight - this.tall;
      const whole = this.filter.length * this.tall;
      return whole <= MOST ? 1 : (whole - room) / (MOST - room);
    }

    get top() {
      return (this.grid.scrollTop * this.scale) / this.tall;
    }

    set top(row) {
      this._stretch(); // browsers do not scroll beyond the present height of the element
      this.grid.scrollTop = (row * this.tall) / this.scale;
      this._placed = this.grid.scrollTop;
    }

    _wheel(event) {
      if (this.scale === 1 || event.ctrlKey) return;
      event.preventDefault();
      this.top = this.top + event.deltaY / this.tall;
      this.handlers.scrolled();
    }

    draw() {
      if (this._waiting) return;
      this._waiting = true;
      requestAnimationFrame(() => {
        this._waiting = false;
        this.paint();
      });
    }

    _stretch() {
      const tall = `${Math.min(this.filter.length * this.tall, MOST)}px`;
      if (this.spacer.style.height !== tall) this.spacer.style.height = tall;
    }

    /* Sets the widths of columns by their content, so that the words have the rest. */
    _widths() {
      const { model, grid } = this;
      const longest = (texts, most) => Math.min(texts.reduce((long, text) => Math.max(long, text.length), 4), most);
      const last = model.stepCount ? Sniffer.moment(model.steps.t[model.stepCount - 1]) : "";
      const widths = [longest([Sniffer.count(model.messageCount)], 11), longest([last, "Time"], 9), longest(model.robots, 16),
        longest(model.about.kinds.map((kind) => kind.name), 16)];
      const key = widths.join();
      if (this._wide === key) return;
      this._wide = key;
      ["number", "time", "name", "type"].forEach((name, at) => grid.style.setProperty(`--${name}`, `${widths[at] + 1}ch`));
    }

    paint() {
      const { filter, grid, rows } = this;
      this._stretch();
      this._widths();
      grid.setAttribute("aria-rowcount", String(filter.length + 1));
      const first = Math.max(Math.floor(this.top), 0);
      const shown = Math.min(this.inWindow + 2, Math.max(filter.length - first, 0));
      const offset = this.scale === 1 ? first * this.tall : grid.scrollTop - (this.top - first) * this.tall;
      while (rows.length < shown) rows.push(this._row());
      rows.forEach((row, at) => {
        row.hidden = at >= shown;
        if (row.hidden) return;
        row.style.transform = `translateY(${offset + at * this.tall}px)`;
        this._fill(row, first + at);
      });
      this._words(first, shown);
      const active = rows.find((row) => !row.hidden && Number(row.dataset.message) === this.view.selected);
      if (active) grid.setAttribute("aria-activedescendant", active.id);
      else grid.removeAttribute("aria-activedescendant");
    }

    _row() {
      const cells = COLUMNS.map(([, name], at) => Sniffer.make("span", { role: "gridcell", class: name, "aria-colindex": String(at + 1) }));
      const row = Sniffer.make("div", { role: "row", class: "row", id: `row-${this.rows.length}` }, ...cells);
      this.spacer.append(row);
      return row;
    }

    _fill(row, at) {
      const { model, view } = this;
      const m = this.filter.at(at);
      const words = this.handlers.words(m);
      const hit = this.marks && this.marks.has(m);
      const key = `${m}|${at}|${view.selected === m}|${words.length}|${hit}|${view.colourBy}|${Sniffer.palette.dark}`;
      if (row.dataset.shown === key) return;
      row.dataset.shown = key;
      row.dataset.message = m;
      row.setAttribute("aria-rowindex", String(at + 2));
      row.setAttribute("aria-selected", String(view.selected === m));
      row.classList.toggle("hit", Boolean(hit));
      row.classList.toggle("odd", at % 2 === 1);
      const { sender, receiver, t } = model.messages;
      const kind = model.kindOf(m);
      const from = model.nameOf(sender[m]);
      const prefix = `${from} says: `; // in the column From
      const texts = [Sniffer.count(m), Sniffer.moment(t[m]), from, model.nameOf(receiver[m]), kind.name,
        words.startsWith(prefix) ? words.slice(prefix.length) : words];
      texts.forEach((text, cell) => {
        row.children[cell].textContent = text;
        row.children[cell].title = cell ? text : "";
      });
      if (kind.performative) row.children[4].append(Sniffer.make("span", { class: "act" }, ` · ${kind.performative.toLowerCase()}`));
      row.children[5].title = words;
      row.children[4].style.color = Sniffer.palette.colour(Sniffer.colouring(model, view.colourBy)(m));
    }

    /* Loads the missing words of the messages in the window. */
    _words(first, shown) {
      const chunks = new Set();
      for (let at = 0; at < shown; at++) chunks.add(this.filter.at(first + at) >> 10);
      const missing = [...chunks].filter((chunk) => !this.handlers.has(chunk, this.model.messageCount));
      if (!missing.length) return;
      clearTimeout(this._asking);
      const ask = () => this.handlers.ask(missing.slice(0, 4));
      const soon = performance.now() - this._askedAt < PAUSE_MS;
      this._askedAt = performance.now();
      if (soon) this._asking = setTimeout(ask, PAUSE_MS);
      else ask();
    }

    /* Scrolls a row into the window: as little as possible if it is near, else with some rows around it. */
    reveal(row) {
      const first = this.top;
      const rows = this.inWindow;
      if (row < first - 2 || row > first + rows + 1) this.top = Math.max(row - rows / 2.5, 0);
      else if (row < first) this.top = row;
      else if (row > first + rows - 1.5) this.top = row - rows + 1.5;
    }
  };
})();
