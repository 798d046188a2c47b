"use strict";
/* An overview of the run next to the chart: messages by type, and the window. A click moves the window. */
(() => {
  const NARROW = 22;

  Sniffer.Minimap = class {
    constructor(model, view, shape, scrolled) {
      Object.assign(this, { model, view, shape, scrolled });
      this.canvas = Sniffer.byId("minimap");
      this.counted = null;
      this.refresh = Sniffer.seldom(200, () => this._count());
      this.canvas.addEventListener("pointerdown", (event) => this._grab(event));
      this.canvas.addEventListener("wheel", (event) => {
        event.preventDefault();
        view.set({ top: view.top + event.deltaY / view.rowHeight });
        scrolled();
      }, { passive: false });
    }

    measure() {
      const box = this.canvas.getBoundingClientRect();
      const sharp = window.devicePixelRatio || 1;
      this.width = box.width;
      this.height = box.height;
      this.canvas.width = Math.round(box.width * sharp);
      this.canvas.height = Math.round(box.height * sharp);
      this._count();
    }

    /* The number of messages by colour in each slice, and the number of shown messages. */
    _count() {
      const { model, view, shape } = this;
      const total = model.messageCount;
      const slices = Math.max(Math.min(Math.floor(this.height / 2), total), 1);
      const colours = new Uint32Array(slices * 8);
      const colourOf = Sniffer.colouring(model, view.colourBy);
      const { filter } = shape;
      const stride = Math.max(1, Math.floor(filter.length / 400000)); // for slices of thousands of messages, an estimate is sufficient
      const scale = slices / Math.max(total, 1);
      for (let row = 0; row < filter.length; row += stride) {
        const m = filter.at(row);
        colours[Math.floor(m * scale) * 8 + (colourOf(m) % 8)] += stride;
      }
      this.counted = { slices, colours, total };
      this._image = null;
      this.paint();
    }

    paint() {
      const { canvas, view, shape, model, counted } = this;
      if (!canvas.width || !counted || !counted.total) return;
      const pen = canvas.getContext("2d", { alpha: false });
      const sharp = canvas.width / this.width;
      const paints = Sniffer.palette.paint;
      const key = `${Sniffer.palette.dark}${view.colourBy}${canvas.width}x${canvas.height}`;
      if (!this._image || this._key !== key) this._picture(key, paints);
      pen.setTransform(1, 0, 0, 1, 0, 0);
      pen.drawImage(this._image, 0, 0);
      pen.setTransform(sharp, 0, 0, sharp, 0, 0);
      this._marks(pen, paints);
      const { filter } = shape;
      if (!filter.length) return;
      const from = this._y(filter.at(Math.min(Math.max(Math.floor(view.top), 0), filter.length - 1)));
      const last = Math.min(Math.floor(view.top + shape.rowsInWindow), filter.length - 1);
      const to = last >= filter.length - 1 ? this.height : this._y(filter.at(Math.max(last, 0)));
      if (view.moment < model.stepCount) {
        pen.fillStyle = paints.now;
        pen.fillRect(0, Math.round(this._y(model.rowOf(view.moment + 1))) - 1, this.width, 2);
      }
      const tall = Math.max(to - from, 10);
      const top = Math.min(from, this.height - tall);
      pen.fillStyle = paints.glow;
      pen.strokeStyle = paints.chosen;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.roundRect(1, top + 1, this.width - 2, tall - 2, 4);
      pen.fill();
      pen.stroke();
    }

    _picture(key, paints) {
      const { slices, colours, total } = this.counted;
      this._key = key;
      this._image = new OffscreenCanvas(this.canvas.width, this.canvas.height);
      const pen = this._image.getContext("2d", { alpha: false });
      const sharp = this.canvas.width / this.width;
      pen.setTransform(sharp, 0, 0, sharp, 0, 0);
      pen.fillStyle = paints.band;
      pen.fillRect(0, 0, this.width, this.height);
      const tall = this.height / slices;
      const room = this.width - NARROW;
      for (let slice = 0; slice < slices; slice++) {
        let x = NARROW / 2;
        const each = Math.ceil(((slice + 1) * total) / slices) - Math.ceil((slice * total) / slices); // the number of messages
        for (let colour = 0; colour < 8; colour++) {
          const wide = (colours[slice * 8 + colour] / Math.max(each, 1)) * room;
          if (!wide) continue;
          pen.fillStyle = Sniffer.palette.colour(colour);
          pen.globalAlpha = 0.75;
          pen.fillRect(x, slice * tall, Math.max(Math.min(wide, room + NARROW / 2 - x), 0), tall + 0.3);
          x += wide;
        }
      }
      pen.globalAlpha = 1;
    }

    /* The hits of the search, and the selected message. */
    _marks(pen, paints) {
      const hits = this.hits || [];
      pen.fillStyle = paints.hit;
      const every = Math.max(1, Math.floor(hits.length / 2000));
      for (let i = 0; i < hits.length; i += every) pen.fillRect(this.width - 8, this._y(hits[i]) - 1, 8, 2);
      if (this.view.selected < 0) return;
      pen.fillStyle = paints.chosen;
      pen.fillRect(0, this._y(this.view.selected) - 2, 8, 4);
    }

    _y(message) {
      return (message / Math.max(this.counted.total, 1)) * this.height;
    }

    _grab(event) {
      const { canvas, view, shape } = this;
      canvas.setPointerCapture(event.pointerId);
      const go = (now) => {
        const part = (now.clientY - canvas.getBoundingClientRect().top) / this.height;
        const row = shape.filter.rowOf(Math.floor(part * this.counted.total));
        view.set({ top: row - shape.rowsInWindow / 2 });
        this.scrolled();
      };
      go(event);
      canvas.addEventListener("pointermove", go);
      for (const name of ["pointerup", "pointercancel"])
        canvas.addEventListener(name, () => canvas.removeEventListener("pointermove", go), { once: true });
    }
  };
})();
