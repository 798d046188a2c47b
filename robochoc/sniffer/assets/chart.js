"use strict";
/* The chart's window: painting, scrolling, and the elements under the pointer. */
(() => {
  const NEAR = 7; // pixels: the largest distance at which the pointer selects an arrow
  const SMALLEST = 2;
  const LARGEST = 64;

  /* The distance of a point from the line between two others. */
  const distance = (x, y, { x1, y1, x2, y2 }) => {
    const along = ((x - x1) * (x2 - x1) + (y - y1) * (y2 - y1)) / ((x2 - x1) ** 2 + (y2 - y1) ** 2 || 1);
    const at = Math.min(Math.max(along, 0), 1);
    return Math.hypot(x - x1 - at * (x2 - x1), y - y1 - at * (y2 - y1));
  };

  Sniffer.Chart = class {
    constructor(model, view, lanes, filter, handlers) {
      Object.assign(this, { model, view, lanes, filter, handlers });
      this.canvas = Sniffer.byId("drawing");
      this.tip = Sniffer.byId("tip");
      this.sideways = Sniffer.byId("sideways");
      this.shape = new Sniffer.Shape(model, view, lanes, filter);
      this.drawing = new Sniffer.Drawing(model, view, this.shape);
      this.heads = new Sniffer.Heads(model, view, lanes, this.shape, handlers);
      this.minimap = new Sniffer.Minimap(model, view, this.shape, () => this.scrolled());
      this.costs = []; // durations of the last frames, in ms
      this._listen();
    }

    _listen() {
      const { canvas, view } = this;
      new ResizeObserver(() => this.measure()).observe(canvas.parentElement);
      canvas.addEventListener("wheel", (event) => this._wheel(event), { passive: false });
      canvas.addEventListener("pointerdown", (event) => this._grab(event));
      canvas.addEventListener("pointermove", (event) => this._point(event));
      canvas.addEventListener("pointerleave", () => this._hover(-1));
      this.sideways.addEventListener("scroll", () => view.set({ left: this.sideways.scrollLeft }));
    }

    measure() {
      const { canvas, shape } = this;
      const box = canvas.getBoundingClientRect();
      if (!box.width || !box.height) return;
      const sharp = window.devicePixelRatio || 1;
      Object.assign(shape, { width: box.width, height: box.height });
      canvas.width = Math.round(box.width * sharp);
      canvas.height = Math.round(box.height * sharp);
      this.minimap.measure();
      this.shape.clamp();
      this.paint(); // immediately, since a resized canvas is empty
    }

    /* One frame shows all changes. */
    draw() {
      if (this._waiting) return;
      this._waiting = true;
      requestAnimationFrame(() => this.paint());
    }

    paint() {
      this._waiting = false;
      const { canvas, shape } = this;
      if (!canvas.width || !canvas.offsetParent) return;
      const began = performance.now();
      const pen = canvas.getContext("2d", { alpha: false });
      const sharp = canvas.width / shape.width;
      pen.setTransform(sharp, 0, 0, sharp, 0, 0);
      this.drawing.paint(pen);
      this.heads.place();
      this.minimap.paint();
      this._placeSideways();
      this.costs.push(performance.now() - began);
      if (this.costs.length > 240) this.costs.shift();
    }

    _placeSideways() {
      const { sideways, shape, view } = this;
      const wide = shape.breadth > shape.width + 1;
      sideways.hidden = !wide;
      const width = `${Math.round(shape.breadth)}px`;
      if (sideways.firstElementChild.style.width !== width) sideways.firstElementChild.style.width = width;
      if (wide && Math.abs(sideways.scrollLeft - view.left) > 1) sideways.scrollLeft = view.left;
    }

    /* The user has moved the window. */
    scrolled() {
      this.clamp();
      this.handlers.scrolled();
    }

    /* Keep the window within the run. Stop following the newest messages if the window is not at them. */
    clamp() {
      const { view, shape } = this;
      shape.clamp();
      if (view.follow && view.top < shape.lowest - 3) view.set({ follow: false });
    }

    scrollBy(rows, pixels = 0) {
      const { view } = this;
      view.set({ top: view.top + rows, left: view.left + pixels });
      this.scrolled();
    }

    /* Scrolls a row into the window, with some rows around it. */
    reveal(row, lane = -1) {
      const { view, shape } = this;
      const rows = shape.rowsInWindow;
      const margin = Math.min(3, rows / 4);
      if (row < view.top + margin || row > view.top + rows - margin - 1) view.set({ top: row - rows / 2.5 });
      if (lane >= 0) {
        const x = shape.x(lane);
        if (x < shape.gutter + 20 || x > shape.width - 20) view.set({ left: view.left + x - shape.width / 2 });
      }
      this.clamp();
    }

    zoom(factor, y = this.shape.height / 2) {
      const { view } = this;
      const rowHeight = Math.min(Math.max(view.rowHeight * factor, SMALLEST), LARGEST);
      view.set({ top: view.top + y / view.rowHeight - y / rowHeight, rowHeight });
      this.shape.clamp();
    }

    widen(factor, x = this.shape.width / 2) {
      const { view, shape } = this;
      const before = shape.laneWidth;
      const laneWidth = Math.min(Math.max(before * factor, 16), 400);
      const at = (x + view.left - shape.start) / before;
      view.set({ laneWidth, left: Math.max(at * laneWidth + shape.start - x, 0) });
      this.shape.clamp();
    }

    /* Shows all lifelines, with the initial row height, and keeps the present position. */
    fit() {
      const { view, filter, shape } = this;
      const row = view.selected >= 0 ? filter.rowOf(view.selected) : -1;
      const top = view.top;
      view.set({ rowHeight: Sniffer.View.ROW, laneWidth: 0, left: 0 });
      if (row >= 0) this.reveal(row);
      else view.set({ top });
      shape.clamp();
    }

    _wheel(event) {
      event.preventDefault();
      const { left, top } = this.canvas.getBoundingClientRect();
      const unit = event.deltaMode === 1 ? 24 : event.deltaMode === 2 ? this.shape.height : 1;
      const [across, down] = [event.deltaX * unit, event.deltaY * unit];
      if (event.ctrlKey && event.shiftKey) this.widen(Math.exp(-(down || across) / 400), event.clientX - left);
      else if (event.ctrlKey || event.metaKey) this.zoom(Math.exp(-down / 300), event.clientY - top);
      else if (event.shiftKey && !across) this.scrollBy(0, down);
      else this.scrollBy(down / this.view.rowHeight, across);
    }

    /* A drag scrolls the window; a click selects the element under the pointer. */
    _grab(event) {
      if (event.button) return;
      const { canvas, view } = this;
      const from = { x: event.clientX, y: event.clientY, top: view.top, left: view.left, moved: false };
      canvas.setPointerCapture(event.pointerId);
      const move = (now) => {
        const [across, down] = [now.clientX - from.x, now.clientY - from.y];
        if (!from.moved && Math.hypot(across, down) < 5) return;
        from.moved = true;
        canvas.classList.add("held");
        view.set({ top: from.top - down / view.rowHeight, left: from.left - across });
        this.scrolled();
      };
      const end = (now) => {
        canvas.removeEventListener("pointermove", move);
        canvas.classList.remove("held");
        if (!from.moved && now.type === "pointerup") this._click(now);
      };
      canvas.addEventListener("pointermove", move);
      for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, end, { once: true });
    }

    /* The element at a point: a step's box, else the nearest arrow, else the message of the row. */
    at(event) {
      const { left, top } = this.canvas.getBoundingClientRect();
      const [x, y] = [event.clientX - left, event.clientY - top];
      const box = this.drawing.boxes.find((one) => Math.abs(one.x - x) <= 7 && y >= one.y - 2 && y <= one.bottom + 2);
      if (box) return { step: box.step };
      let best = null;
      let nearest = NEAR;
      for (const arrow of this.drawing.arrows) {
        const far = distance(x, y, arrow);
        if (far < nearest) [best, nearest] = [arrow, far];
      }
      if (best) return { message: best.m };
      const row = this.shape.rowAt(y);
      if (row < 0 || row >= this.filter.length) return {};
      const m = this.filter.at(row);
      const arrow = this.drawing.arrows.find((one) => one.m === m);
      const [low, high] = arrow ? [Math.min(arrow.x1, arrow.x2) - 12, Math.max(arrow.x1, arrow.x2) + 12] : [0, -1];
      return x < this.shape.gutter || (x >= low && x <= high) ? { message: m } : {};
    }

    _click(event) {
      const { message, step } = this.at(event);
      if (message !== undefined) this.handlers.message(message);
      else if (step !== undefined) this.handlers.step(step);
      else {
        const lane = this.lanes.list[this.shape.laneAt(event.clientX - this.canvas.getBoundingClientRect().left)];
        if (lane && lane.robots.length === 1 && !lane.others) this.handlers.robot(lane.robots[0]);
      }
    }

    _point(event) {
      if (event.buttons) return this._hover(-1);
      const { message = -1, step = -1 } = this.at(event);
      this.canvas.classList.toggle("over", message >= 0 || step >= 0);
      this._hover(message, step, event);
      return undefined;
    }

    _hover(message, step = -1, event = null) {
      if (message !== this.drawing.hover) {
        this.drawing.hover = message;
        this.draw();
      }
      const { tip } = this;
      tip.hidden = message < 0 && step < 0;
      if (tip.hidden) return;
      Sniffer.fill(tip, ...(message >= 0 ? this._ofMessage(message) : this._ofStep(step)));
      const { width, height } = tip.getBoundingClientRect();
      const x = Math.min(event.clientX + 14, innerWidth - width - 8);
      const y = event.clientY + 18 + height > innerHeight ? event.clientY - height - 10 : event.clientY + 18;
      tip.style.transform = `translate(${Math.max(x, 4)}px, ${Math.max(y, 4)}px)`;
    }

    _ofMessage(m) {
      const { model } = this;
      const { sender, receiver, t, bytes } = model.messages;
      const kind = model.kindOf(m);
      const taken = model.receivedStep[m];
      const fate = taken === Sniffer.NONE ? (model.whole ? "never received" : "not received yet")
        : `received after ${Sniffer.moment(model.steps.t[taken] - t[m])}`;
      return [
        Sniffer.make("strong", {}, `${Sniffer.count(m)} ${kind.name}`),
        Sniffer.make("span", {}, `${model.nameOf(sender[m])} → ${model.nameOf(receiver[m])}`),
        this.handlers.words(m) ? Sniffer.make("em", {}, this.handlers.words(m)) : null,
        Sniffer.make("small", {}, `t = ${Sniffer.moment(t[m])}, ${fate}, ${Sniffer.many(bytes[m], "byte")}`),
      ];
    }

    _ofStep(step) {
      const { model } = this;
      const robot = model.steps.robot[step];
      const took = model.packetOf(step).length;
      const said = model.saidIn(step).length;
      return [
        Sniffer.make("strong", {}, model.nameOf(robot)),
        Sniffer.make("span", {}, `its step ${Sniffer.count(model.ordinal[step] + 1)}, step ${Sniffer.count(step + 1)} of all`),
        Sniffer.make("span", {}, model.valueAt(robot, step) || "no value"),
        Sniffer.make("small", {}, `received ${Sniffer.count(took)}, sent ${Sniffer.count(said)}`),
      ];
    }
  };
})();
