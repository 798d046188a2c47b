"use strict";
/* Positions on the chart, in pixels of its canvas: lifelines are columns, messages are rows. */
(() => {
  const NARROWEST = 14;
  const MARGIN = 22; // for texts to the left of the first lifeline
  const WIDEST = 230;

  Sniffer.Shape = class {
    constructor(model, view, lanes, filter) {
      Object.assign(this, { model, view, lanes, filter, width: 600, height: 400 });
    }

    /* Room for the messages' numbers. */
    get gutter() {
      return 22 + 7.2 * Math.max(String(this.model.messageCount).length, 3);
    }

    get start() {
      return this.gutter + MARGIN;
    }

    get laneWidth() {
      const room = (this.width - this.gutter - MARGIN - 10) / Math.max(this.lanes.list.length, 1);
      return this.view.laneWidth || Math.min(Math.max(room, NARROWEST), WIDEST);
    }

    /* All lifelines, side by side. */
    get breadth() {
      return this.gutter + MARGIN + this.laneWidth * this.lanes.list.length + 10;
    }

    get rowsInWindow() {
      return this.height / this.view.rowHeight;
    }

    /* The lowest scroll position: a little below the last message, where final steps without messages are. */
    get lowest() {
      return Math.max(this.filter.length + 2 - this.rowsInWindow, 0);
    }

    get farthest() {
      return Math.max(this.breadth - this.width, 0);
    }

    x(lane) {
      return this.start + (lane + 0.5) * this.laneWidth - this.view.left;
    }

    xOf(robot) {
      return this.x(this.lanes.of[robot] || 0);
    }

    top(row) {
      return (row - this.view.top) * this.view.rowHeight;
    }

    y(row) {
      return this.top(row + 0.5);
    }

    /* A step is in the row of its first message; steps without messages share the upper half of the next row. */
    yOfStep(step) {
      const row = this.filter.rowOf(this.model.rowOf(step));
      return this.top(row + 0.5 * this.model.placeOf(step));
    }

    /* The line after the moment: later events are below it. */
    yOfMoment(step) {
      return Math.max(this.top(this.filter.rowOf(this.model.rowOf(step + 1))), this.yOfStep(step) + 5);
    }

    rowAt(y) {
      return Math.floor(this.view.top + y / this.view.rowHeight);
    }

    laneAt(x) {
      const lane = Math.floor((x + this.view.left - this.start) / this.laneWidth);
      return x >= this.gutter && lane >= 0 && lane < this.lanes.list.length ? lane : -1;
    }

    /* Keeps the window within the chart. */
    clamp() {
      const { view } = this;
      view.set({
        top: Math.min(Math.max(view.top, 0), this.lowest),
        left: Math.min(Math.max(view.left, 0), this.farthest),
      });
    }
  };
})();
