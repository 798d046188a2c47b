"use strict";
/* Counters over time: `Sniffer.counters(element, model) -> {show(step), update()}`.

   Three small charts over the run's steps: messages sent, received and in transit; the clock of non-concurrent constraint
   checks; messages by type. The numbers at the present moment are in a table below. A click (or a drag) on a chart
   sends `moment` with the step in `detail`, from the element upwards. */
(() => {
  const SAMPLES = 512; // the maximum number of points; with more, every other point is dropped
  const HEIGHT = 76;
  const KINDS = 8; // the number of types with their own line, and of colours

  /* The number of messages in transit when `run` began: messages in transit at the end of a run are lost. */
  const lost = (model, run) => {
    const began = model.about.runs[run];
    return began ? began.message - (began.step ? model.steps.packetEnd[began.step - 1] : 0) : 0;
  };

  /* The running sums at every `every`-th step, so that the number of drawn points is limited. */
  class Sums {
    constructor() {
      this.every = 1;
      this.steps = 0; // steps counted so far
      this.messages = 0;
      this.clock = 0;
      this.run = -1;
      this.kinds = [];
      this.rows = []; // {sent, received, way, clock, kinds} after each `every` steps
    }

    add(model) {
      const { messages, steps, messageCount, about } = model;
      const whole = messageCount >= about.messages;
      const upto = whole ? model.stepCount : Math.min(model.stepCount, messageCount ? messages.step[messageCount - 1] : 0);
      while (this.steps < upto) {
        const step = this.steps;
        while (this.messages < messageCount && messages.step[this.messages] <= step) {
          const kind = messages.kind[this.messages++];
          this.kinds[kind] = (this.kinds[kind] || 0) + 1;
        }
        if (steps.run[step] !== this.run) {
          this.run = steps.run[step];
          this.clock = 0;
        }
        this.clock = Math.max(this.clock, steps.clock[step]);
        this.steps++;
        this.now = { sent: this.messages, received: steps.packetEnd[step], clock: this.clock, kinds: this.kinds,
          way: this.messages - steps.packetEnd[step] - lost(model, this.run) };
        if (this.steps % this.every === 0) this.keep();
      }
    }

    keep() {
      this.rows.push({ ...this.now, kinds: [...this.kinds] });
      if (this.rows.length <= SAMPLES) return;
      this.rows = this.rows.filter((_, place) => place % 2);
      this.every *= 2;
    }
  }

  /* The exact counts at the end of `step`. */
  const countedAt = (model, sums, step) => {
    const { messages, steps } = model;
    const place = Math.floor((step + 1) / sums.every) - 1;
    const before = sums.rows[place] || { sent: 0, received: 0, clock: 0, kinds: [] };
    const kinds = [...before.kinds];
    let { sent, clock } = before;
    let run = place >= 0 ? steps.run[(place + 1) * sums.every - 1] : -1;
    for (let s = (place + 1) * sums.every; s <= step; s++) {
      if (steps.run[s] !== run) {
        run = steps.run[s];
        clock = 0;
      }
      clock = Math.max(clock, steps.clock[s]);
    }
    for (; sent < model.messageCount && messages.step[sent] <= step; sent++) kinds[messages.kind[sent]] = (kinds[messages.kind[sent]] || 0) + 1;
    const received = steps.packetEnd[step];
    return { sent, received, way: sent - received - lost(model, steps.run[step]), clock, kinds };
  };

  class Chart {
    constructor(title, lines, choose, again = "┊ new run") {
      this.title = title;
      this.again = again;
      this.lines = lines; // () -> [{name, colour, dash, of(row)}]
      this.canvas = Sniffer.make("canvas", { role: "img" });
      this.canvas.style.cssText = `display:block;width:100%;height:${HEIGHT}px;cursor:crosshair;touch-action:pan-y`;
      this.key = Sniffer.make("p", { class: "key", "aria-hidden": "true" });
      this.figure = Sniffer.make("figure", {}, Sniffer.make("figcaption", {}, title), this.canvas, this.key);
      this.figure.style.margin = "0 0 .6rem";
      const pick = (event) => {
        if (event.buttons & 1) choose((event.clientX - this.canvas.getBoundingClientRect().left) / this.canvas.clientWidth);
      };
      this.canvas.addEventListener("pointerdown", (event) => {
        this.canvas.setPointerCapture(event.pointerId);
        pick(event);
      });
      this.canvas.addEventListener("pointermove", pick);
    }

    draw(sums, stepCount, moment, runs) {
      const width = this.canvas.clientWidth;
      if (!width || !sums.now) return;
      const paint = Sniffer.palette.paint;
      const ratio = devicePixelRatio || 1;
      this.canvas.width = Math.round(width * ratio);
      this.canvas.height = Math.round(HEIGHT * ratio);
      const pen = this.canvas.getContext("2d");
      pen.scale(ratio, ratio);
      const lines = this.lines();
      const rows = [...sums.rows, sums.now];
      const most = Math.max(1, ...lines.map((line) => rows.reduce((high, row) => Math.max(high, line.of(row)), 0)));
      const x = (place) => (place < sums.rows.length ? ((place + 1) * sums.every) / stepCount : sums.steps / stepCount) * width;
      const y = (value) => HEIGHT - 3 - (value / most) * (HEIGHT - 16);
      pen.fillStyle = paint.band;
      pen.fillRect(0, 0, width, HEIGHT);
      pen.strokeStyle = paint.line;
      pen.beginPath();
      for (const part of [0, 0.5, 1]) {
        pen.moveTo(0, Math.round(y(part * most)) + 0.5);
        pen.lineTo(width, Math.round(y(part * most)) + 0.5);
      }
      pen.stroke();
      this.begun(pen, runs, stepCount, width);
      for (const line of lines) {
        pen.strokeStyle = line.colour;
        pen.lineWidth = 1.6;
        pen.setLineDash(line.dash);
        pen.beginPath();
        pen.moveTo(0, y(0));
        rows.forEach((row, place) => pen.lineTo(x(place), y(line.of(row))));
        pen.stroke();
      }
      pen.setLineDash([]);
      pen.fillStyle = paint.soft;
      pen.font = "11px system-ui, sans-serif";
      pen.fillText(Sniffer.count(Math.round(most)), 4, 10);
      pen.strokeStyle = paint.now;
      pen.lineWidth = 1.5;
      pen.beginPath();
      const now = ((moment + 1) / stepCount) * width;
      pen.moveTo(Math.min(now, width - 1), 0);
      pen.lineTo(Math.min(now, width - 1), HEIGHT);
      pen.stroke();
      const last = lines.map((line) => `${line.name} ${Sniffer.count(line.of(sums.now))}`).join(", ");
      this.canvas.setAttribute("aria-label", `${this.title} over ${Sniffer.many(stepCount, "step")}; at the end: ${last}`);
      this.key.style.cssText = "margin:.1rem 0 0";
      const again = runs.length > 1 ? [Sniffer.make("span", { class: "soft" }, this.again)] : [];
      Sniffer.fill(this.key, ...lines.map((line) => {
        const mark = Sniffer.make("span", {}, `${line.dash.length ? "╌" : "—"} ${line.name}`);
        mark.style.cssText = `color:${line.colour};margin-right:.8em;white-space:nowrap`;
        return mark;
      }), ...again);
    }

    /* A line at the start of another run or epoch: messages in transit are lost there, and the clocks restart. */
    begun(pen, runs, stepCount, width) {
      pen.strokeStyle = Sniffer.palette.paint.soft;
      pen.lineWidth = 1;
      pen.setLineDash([2, 3]);
      pen.beginPath();
      for (const { step } of runs) {
        if (!step || step >= stepCount) continue;
        const at = Math.round((step / stepCount) * width) + 0.5;
        pen.moveTo(at, 0);
        pen.lineTo(at, HEIGHT);
      }
      pen.stroke();
      pen.setLineDash([]);
    }
  }

  class Counters {
    constructor(element, model) {
      this.model = model;
      this.sums = new Sums();
      this.moment = 0;
      const choose = (part) => {
        const last = this.model.stepCount - 1;
        if (last < 0) return;
        const step = Math.max(0, Math.min(last, Math.round(part * this.model.stepCount) - 1));
        element.dispatchEvent(new CustomEvent("moment", { bubbles: true, detail: step }));
      };
      const colour = (index) => Sniffer.palette.colour(index);
      const dash = (index) => Sniffer.palette.dash(index);
      this.charts = [
        new Chart("Messages", () => [
          { name: "sent", colour: colour(0), dash: dash(0), of: (row) => row.sent },
          { name: "received", colour: colour(1), dash: dash(1), of: (row) => row.received },
          { name: "in transit", colour: colour(2), dash: dash(2), of: (row) => row.way },
        ], choose),
        new Chart("Non-concurrent constraint checks", () => [
          { name: "NCCC", colour: colour(3), dash: dash(0), of: (row) => row.clock },
        ], choose, "┊ new run, NCCCs restart at 0"),
        new Chart("By type", () => this.kinds().map((kind) => (
          { name: this.model.about.kinds[kind].name, colour: colour(kind), dash: dash(kind), of: (row) => row.kinds[kind] || 0 }
        )), choose),
      ];
      this.table = Sniffer.make("table", { class: "numbers" });
      const pane = Sniffer.make("div", {}, ...this.charts.map((chart) => chart.figure), this.table);
      pane.style.cssText = "padding:.5rem .7rem;font-size:.85rem";
      this.table.style.cssText = "border-collapse:collapse;font-variant-numeric:tabular-nums";
      Sniffer.fill(element, pane);
      const again = () => this.later();
      new ResizeObserver(again).observe(element);
      new MutationObserver(again).observe(document.documentElement, { attributeFilter: ["data-theme"] });
      Sniffer.palette.watch(again);
      this.update();
    }

    /* The most frequent types. */
    kinds() {
      const { kindCounts, about } = this.model;
      return about.kinds.map((_, kind) => kind).sort((a, b) => kindCounts[b] - kindCounts[a]).slice(0, KINDS);
    }

    update() {
      this.sums.add(this.model);
      this.later();
    }

    show(step) {
      this.moment = step;
      this.later();
    }

    later() {
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this.draw();
      });
    }

    draw() {
      const { model, sums } = this;
      if (!sums.steps) return;
      const moment = Math.min(this.moment, sums.steps - 1);
      for (const chart of this.charts) chart.draw(sums, model.stepCount, moment, model.about.runs);
      const now = countedAt(model, sums, moment);
      const all = sums.now;
      const cell = (name, properties, text, align) => {
        const made = Sniffer.make(name, properties, text);
        made.style.cssText = `text-align:${align};padding:.1rem .9rem .1rem 0;font-weight:${name === "td" ? 400 : 600}`;
        return made;
      };
      const row = (name, of) => Sniffer.make("tr", {}, cell("th", { scope: "row" }, name, "left"),
        cell("td", {}, Sniffer.count(of(now)), "right"), cell("td", {}, Sniffer.count(of(all)), "right"));
      const head = Sniffer.make("tr", {}, Sniffer.make("td"), cell("th", { scope: "col" }, "now", "right"),
        cell("th", { scope: "col" }, "in all", "right"));
      Sniffer.fill(this.table,
        Sniffer.make("caption", { class: "hide" }, "Counters now and of the whole run"),
        Sniffer.make("thead", {}, head),
        Sniffer.make("tbody", {},
          row("sent", (at) => at.sent),
          row("received", (at) => at.received),
          row("in transit", (at) => at.way),
          row("NCCC", (at) => at.clock),
          ...this.kinds().map((kind) => row(model.about.kinds[kind].name, (at) => at.kinds[kind] || 0))));
    }
  }

  Sniffer.counters = (element, model) => new Counters(element, model);
})();
