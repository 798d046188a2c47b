"use strict";
/* Paints the chart. Only the content of the window is painted, so that the cost of a frame does not depend on the run. */
(() => {
  const PASSING = 400; // the maximum number of arrows that only pass through the window
  const STEPS = 4000; // of more steps between two rows, only those with messages are painted
  const FONT = "12px system-ui, sans-serif";
  const SMALL = "11px system-ui, sans-serif";

  const widths = new Map();
  const widthOf = (pen, text) => {
    const key = pen.font + text;
    let width = widths.get(key);
    if (width === undefined) {
      if (widths.size > 5000) widths.clear();
      widths.set(key, (width = pen.measureText(text).width));
    }
    return width;
  };

  Sniffer.Drawing = class {
    constructor(model, view, shape) {
      Object.assign(this, { model, view, shape, hover: -1 });
      this.arrows = []; // the painted elements, for the pointer
      this.boxes = [];
      this.pills = new Set();
    }

    paint(pen) {
      const { shape, view } = this;
      this.pen = pen;
      this.paints = Sniffer.palette.paint;
      this.colourOf = Sniffer.colouring(this.model, view.colourBy);
      this.arrows.length = this.boxes.length = 0;
      this.first = Math.max(Math.floor(view.top) - 1, 0);
      this.last = Math.min(Math.ceil(view.top + shape.rowsInWindow), shape.filter.length - 1);
      this._relate();
      pen.fillStyle = this.paints.paper;
      pen.fillRect(0, 0, shape.width, shape.height);
      pen.textBaseline = "middle";
      this._lifelines();
      this._rowsBehind();
      if (!shape.filter.done) return;
      this._runs();
      this._passing();
      for (let row = this.first; row <= this.last; row++) this._arrow(shape.filter.at(row), row);
      this._steps();
      this._runNames();
      if (view.rowHeight >= 13) for (let row = this.first; row <= this.last; row++) this._label(shape.filter.at(row), row);
      this._numbers();
      this._moment();
    }

    /* Highlights the causes and consequences of the selected message; other messages are dimmed. */
    _relate() {
      const { model, view } = this;
      this.related = new Map();
      if (view.selected < 0 || view.selected >= model.messageCount) return;
      for (const m of model.causesOf(view.selected)) this.related.set(m, "cause");
      for (const m of model.consequencesOf(view.selected)) this.related.set(m, "then");
      this.related.set(view.selected, "this");
    }

    /* The sender and receiver of the chosen message have a lighter background; the chosen robot's lifeline is bold. */
    _lifelines() {
      const { pen, shape, paints, view, model } = this;
      const { list } = shape.lanes;
      const m = view.selected < model.messageCount ? view.selected : -1;
      const parties = new Set(m < 0 ? [] : [shape.lanes.of[model.messages.sender[m]], shape.lanes.of[model.messages.receiver[m]]]);
      if (shape.lanes.others >= 0) parties.delete(shape.lanes.others);
      const from = Math.max(Math.floor((view.left - shape.laneWidth) / shape.laneWidth), 0);
      for (let lane = from; lane < list.length; lane++) {
        const x = shape.x(lane);
        if (x - shape.laneWidth > shape.width) break;
        if (parties.has(lane)) {
          pen.fillStyle = paints.glow;
          pen.fillRect(x - shape.laneWidth / 2, 0, shape.laneWidth, shape.height);
        }
        const chosen = view.robot >= 0 && list[lane].robots.includes(view.robot) && !list[lane].others;
        pen.strokeStyle = chosen ? paints.chosen : list[lane].others ? paints.others : paints.line;
        pen.lineWidth = list[lane].group || chosen ? 3 : 1;
        pen.setLineDash(list[lane].others ? [2, 5] : []);
        pen.beginPath();
        pen.moveTo(Math.round(x) + 0.5, 0);
        pen.lineTo(Math.round(x) + 0.5, Math.min(shape.top(shape.filter.length + 1), shape.height));
        pen.stroke();
      }
      pen.setLineDash([]);
    }

    _rowsBehind() {
      const { pen, shape, paints, view } = this;
      const { rowHeight } = view;
      for (let row = this.first; row <= this.last; row++) {
        const m = shape.filter.at(row);
        const marked = m === view.selected || m === this.hover;
        if (!marked && (row & 1 || rowHeight < 12)) continue;
        pen.fillStyle = marked ? paints.glow : paints.band;
        pen.globalAlpha = marked ? 1 : 0.45;
        pen.fillRect(0, shape.top(row), shape.width, rowHeight);
      }
      pen.globalAlpha = 1;
    }

    /* A line at the start of another run or epoch. */
    _runs() {
      const { pen, shape, paints, model } = this;
      this.begun = [];
      for (const run of model.about.runs) {
        if (!run.message || run.message > model.messageCount) continue;
        const y = shape.top(shape.filter.rowOf(run.message));
        if (y < -20 || y > shape.height + 20) continue;
        pen.strokeStyle = paints.soft;
        pen.lineWidth = 1;
        pen.beginPath();
        pen.moveTo(shape.gutter, y);
        pen.lineTo(shape.width, y);
        pen.stroke();
        this.begun.push([run, y]);
      }
    }

    /* Above all other elements. */
    _runNames() {
      const { pen, shape, paints } = this;
      for (const [run, y] of this.begun) {
        pen.font = SMALL;
        pen.textAlign = "right";
        const name = Sniffer.runName(run);
        const width = widthOf(pen, name) + 10;
        pen.fillStyle = paints.paper;
        pen.fillRect(shape.width - 4 - width, y + 1, width, 16);
        pen.fillStyle = paints.soft;
        pen.fillText(name, shape.width - 9, y + 9);
      }
    }

    _passing() {
      const { shape, model } = this;
      if (this.first >= shape.filter.length) return;
      const message = shape.filter.at(this.first);
      const passing = model.passing(message, model.firstStepAt(message), PASSING).filter((m) => shape.filter.shows(m));
      const waiting = new Map(); // by lifeline: with more waiting messages, each is fainter
      for (const m of passing) {
        const lane = shape.lanes.of[model.messages.receiver[m]];
        waiting.set(lane, (waiting.get(lane) || 0) + 1);
      }
      for (const m of passing) this._arrow(m, shape.filter.rowOf(m), waiting.get(shape.lanes.of[model.messages.receiver[m]]) ** -0.7);
    }

    _arrow(m, row, part = 1) {
      const { pen, shape, model, view } = this;
      const { sender, receiver } = model.messages;
      const taken = model.receivedStep[m];
      const x1 = shape.xOf(sender[m]);
      let x2 = shape.xOf(receiver[m]);
      const y1 = shape.y(row);
      const lost = taken === Sniffer.NONE;
      let y2 = lost ? y1 + Math.min(view.rowHeight * 0.8, 20) : shape.yOfStep(taken);
      if (lost) x2 = x1 + (x2 - x1) * 0.7 || x1 + 24;
      const how = this.related.get(m);
      const bold = how || m === this.hover;
      const span = (y2 - y1) / Math.max(view.rowHeight, 6);
      const fading = view.arrows === "straight" ? Math.max(0.22, Math.min(0.95, 1.1 - span / 40)) : 0.9;
      const faint = fading * part * (this.related.size && !how ? 0.6 : 1);
      const colour = Sniffer.palette.colour(this.colourOf(m));
      pen.globalAlpha = bold ? 1 : faint;
      pen.strokeStyle = pen.fillStyle = colour;
      pen.lineWidth = bold ? 2.6 : 1.3;
      pen.setLineDash(lost && !model.whole ? [2, 4] : Sniffer.palette.dash(this.colourOf(m)));
      const side = x2 > x1 ? 5 : -5;
      const bend = Math.min(y2, y1 + Math.min(view.rowHeight * 0.5, 14));
      pen.beginPath();
      if (x1 === x2) this._loop(x1, y1, y2, bold);
      else if (lost || view.arrows === "straight" || y2 - bend < view.rowHeight) {
        pen.moveTo(x1 + side, y1);
        pen.lineTo(x2 - (lost ? 0 : side * 1.6), y2);
        pen.stroke();
        pen.setLineDash([]);
        if (!lost) this._point(x2 - side, y2, x1, y1, bold);
        else if (model.whole) this._cross(x2, y2);
      } else y2 = this._bent({ x1, y1, x2, y2, side, bend, bold });
      pen.globalAlpha = 1;
      this.arrows.push({ m, x1, y1, x2, y2 });
    }

    /* Messages to the same lifeline, between robots of a group or of the others. */
    _loop(x, y1, y2, bold) {
      const { pen } = this;
      const out = x + Math.min(34, this.shape.laneWidth * 0.45);
      pen.moveTo(x + 5, y1);
      pen.bezierCurveTo(out, y1, out, y2, x + 6, y2);
      pen.stroke();
      pen.setLineDash([]);
      this._point(x + 5, y2, out, y2, bold);
    }

    /* A message that waits long crosses at once, and then waits beside the receiver's lifeline for the step that receives
       it, so that the receiver and the number of waiting messages are visible. Returns the lowest y of the clickable part. */
    _bent({ x1, y1, x2, y2, side, bend, bold }) {
      const { pen } = this;
      const beside = x2 - side * 1.4;
      if (y1 > -20) {
        pen.moveTo(x1 + side, y1);
        pen.lineTo(beside, bend);
        pen.stroke();
      }
      pen.setLineDash([]);
      pen.lineWidth = bold ? 2.2 : 1;
      pen.globalAlpha *= bold ? 1 : 0.6;
      pen.beginPath();
      pen.moveTo(beside, Math.max(bend, -5));
      pen.lineTo(beside, Math.min(y2 - 6, this.shape.height + 5));
      pen.stroke();
      if (y2 < this.shape.height + 12) this._point(x2 - side * 0.9, y2, beside - side * 0.4, y2 - 9, bold);
      return bend;
    }

    _point(x, y, fromX, fromY, bold) {
      const { pen } = this;
      const angle = Math.atan2(y - fromY, x - fromX);
      const size = bold ? 10 : 7.5;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x - size * Math.cos(angle - 0.42), y - size * Math.sin(angle - 0.42));
      pen.lineTo(x - size * Math.cos(angle + 0.42), y - size * Math.sin(angle + 0.42));
      pen.fill();
    }

    _cross(x, y) {
      const { pen } = this;
      pen.strokeStyle = this.paints.lost;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(x - 4.5, y - 4.5);
      pen.lineTo(x + 4.5, y + 4.5);
      pen.moveTo(x + 4.5, y - 4.5);
      pen.lineTo(x - 4.5, y + 4.5);
      pen.stroke();
    }

    _steps() {
      const { shape, model } = this;
      const { filter } = shape;
      if (!filter.length) return;
      const top = filter.at(Math.min(this.first, filter.length - 1));
      const bottom = this.last >= filter.length - 1 ? model.messageCount + 1 : filter.at(Math.max(this.last, 0)) + 1;
      const from = Math.min(model.firstStepAt(top), model.messages.step[top]);
      const to = bottom > model.messageCount ? model.stepCount : model.firstStepAt(bottom);
      this.pills.clear();
      if (to - from <= STEPS) for (let step = from; step < to && step < model.stepCount; step++) this._step(step);
      else {
        const seen = new Set();
        for (const { m } of this.arrows) {
          seen.add(model.messages.step[m]);
          if (model.receivedStep[m] !== Sniffer.NONE) seen.add(model.receivedStep[m]);
        }
        for (const step of seen) if (step < model.stepCount) this._step(step);
      }
    }

    _step(step) {
      const { pen, shape, model, paints, view } = this;
      const robot = model.steps.robot[step];
      const lane = shape.lanes.of[robot];
      if (lane === shape.lanes.others) return;
      const x = shape.x(lane);
      const y = shape.yOfStep(step);
      if (x < -60 || x > shape.width + 60 || y > shape.height + 30) return;
      const last = step < model.lastSaid.length ? model.lastSaid[step] : Sniffer.NONE;
      const bottom = last === Sniffer.NONE ? y : Math.max(y, shape.y(shape.filter.rowOf(last + 1) - 1));
      if (bottom < -30) return;
      const thin = view.rowHeight < 8;
      const chosen = step === view.moment;
      pen.fillStyle = chosen ? paints.chosen : paints.box;
      pen.strokeStyle = chosen ? paints.chosen : paints.rim;
      pen.lineWidth = 1;
      const half = thin ? 2.5 : 4.5;
      const pad = thin ? 1 : last === Sniffer.NONE ? 2.5 : 4.5;
      pen.beginPath();
      pen.roundRect(x - half, y - pad, half * 2, bottom - y + pad * 2, 2);
      pen.fill();
      pen.stroke();
      this.boxes.push({ step, x, y: y - pad, bottom: bottom + pad });
      const decision = model.decisionAt.get(step);
      if (decision !== undefined && view.rowHeight >= 13) this._pill(step, decision, x, y);
      else if (decision !== undefined) {
        pen.fillStyle = paints.pillRim;
        pen.fillRect(x - 6, y - 1, 12, 2);
      }
    }

    /* A robot's present value, on the side of its lifeline that is opposite to its first message. */
    _pill(step, decision, x, y) {
      const { pen, shape, model, paints } = this;
      pen.font = SMALL;
      const short = shape.laneWidth >= 110 ? decision : decision === "no value" ? "–" : decision.replace(/^.* = /, "= ");
      const text = short.length > 22 ? `${short.slice(0, 21)}…` : short;
      const width = widthOf(pen, text) + 10;
      const first = model.firstSaid[step];
      const right = first !== undefined && first !== Sniffer.NONE && shape.xOf(model.messages.receiver[first]) < x;
      const left = right && x + 9 + width < shape.width ? x + 9 : x - 9 - width;
      pen.fillStyle = paints.pill;
      pen.strokeStyle = paints.pillRim;
      pen.lineWidth = 1;
      pen.beginPath();
      pen.roundRect(left, y - 8, width, 16, 8);
      pen.fill();
      pen.stroke();
      pen.fillStyle = paints.pillInk;
      pen.textAlign = "left";
      pen.fillText(text, left + 5, y + 0.5);
    }

    /* The type, and the performative if there is room, above the start of the arrow. Each row has only one message. */
    _label(m, row) {
      const { pen, shape, model } = this;
      const { sender, receiver } = model.messages;
      const x1 = shape.xOf(sender[m]);
      const x2 = shape.xOf(receiver[m]);
      if ((x1 < 0 && x2 < 0) || (x1 > shape.width && x2 > shape.width)) return;
      const kind = model.kindOf(m);
      const right = x2 >= x1;
      pen.font = this.related.has(m) ? `bold ${FONT}` : FONT;
      const room = Math.max(Math.abs(x2 - x1) - 20, 58);
      const whole = kind.performative ? `${kind.name} · ${kind.performative.toLowerCase()}` : kind.name;
      let text = widthOf(pen, whole) <= room ? whole : kind.name;
      while (text.length > 2 && widthOf(pen, text) > room) text = `${text.slice(0, -2)}…`;
      const from = Math.min(Math.max(x1, shape.gutter - 10), shape.width);
      pen.textAlign = right ? "left" : "right";
      pen.globalAlpha = this.related.size && !this.related.has(m) ? 0.75 : 1;
      const at = right ? from + 12 : Math.max(from - 12, shape.gutter + widthOf(pen, text)); // not behind the numbers
      this._text(text, at, shape.y(row) - 6, Sniffer.palette.colour(this.colourOf(m)));
      pen.globalAlpha = 1;
    }

    /* Text with an outline in the background colour, for readability on lines. */
    _text(text, x, y, colour) {
      const { pen } = this;
      pen.lineWidth = 3.5;
      pen.lineJoin = "round";
      pen.strokeStyle = this.paints.paper;
      pen.strokeText(text, x, y);
      pen.fillStyle = colour;
      pen.fillText(text, x, y);
    }

    _numbers() {
      const { pen, shape, paints, view } = this;
      const every = Math.max(1, Math.ceil(14 / view.rowHeight));
      pen.fillStyle = paints.paper;
      pen.fillRect(0, 0, shape.gutter - 6, shape.height);
      pen.font = SMALL;
      pen.textAlign = "right";
      for (let row = this.first; row <= this.last; row++) {
        const m = shape.filter.at(row);
        const how = this.related.get(m);
        if (row % every && !how) continue;
        const hit = this.marks && this.marks.has(m);
        pen.fillStyle = how ? paints.chosen : hit ? paints.hit : paints.soft;
        if (how || hit) pen.fillRect(0, shape.top(row) + 1, 3, Math.max(view.rowHeight - 2, 2));
        const sign = { cause: "▴ ", then: "▾ " }[how] || "";
        pen.fillText(sign + Sniffer.count(m), shape.gutter - 11, shape.y(row));
      }
    }

    _moment() {
      const { pen, shape, paints, view, model } = this;
      if (view.moment >= model.stepCount) return;
      const y = shape.yOfMoment(view.moment);
      if (y < shape.height) {
        pen.fillStyle = paints.later;
        pen.fillRect(0, Math.max(y, 0), shape.width, shape.height);
      }
      if (y < 0 || y > shape.height) return;
      pen.strokeStyle = paints.now;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.moveTo(0, Math.round(y));
      pen.lineTo(shape.width, Math.round(y));
      pen.stroke();
    }
  };
})();
