"use strict";
/* The loaded part of a run as columns, and derived data: received and sent messages of steps, positions of steps among
   messages, and values over time. All data are append-only.

   This file must be first. The others may be in any order, since they use each other only in later calls. */
window.Sniffer = {};
(() => {
  const NONE = 0xffffffff;
  const BLOCK = 256;

  const MESSAGE = [["t", Float64Array], ["clock", Float64Array], ["step", Uint32Array], ["bytes", Uint32Array],
    ["sender", Uint16Array], ["receiver", Uint16Array], ["kind", Uint16Array], ["run", Uint16Array]];

  /* The first index in `sorted`[0, length) with an entry not less than `value`. */
  const lowerBound = (sorted, value, length = sorted.length) => {
    let low = 0;
    let high = length;
    while (low < high) {
      const middle = (low + high) >>> 1;
      if (sorted[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low;
  };

  /* A growing typed array. `fill`: the initial value of entries. */
  class Growing {
    constructor(Type, fill = 0) {
      this.length = 0;
      this.fill = fill;
      this.all = new Type(1024);
      if (fill) this.all.fill(fill);
    }

    reserve(length) {
      if (length <= this.all.length) return;
      const wider = new this.all.constructor(Math.max(length, this.all.length * 2));
      wider.set(this.all);
      if (this.fill) wider.fill(this.fill, this.all.length);
      this.all = wider;
    }

    append(values) {
      this.reserve(this.length + values.length);
      this.all.set(values, this.length);
      this.length += values.length;
    }

    push(value) {
      this.reserve(this.length + 1);
      this.all[this.length++] = value;
    }
  }

  Object.assign(Sniffer, { NONE, Growing, lowerBound });

  Sniffer.Model = class {
    constructor(about) {
      this.columns = { m: {}, s: {} };
      for (const [name, Type] of MESSAGE) this.columns.m[name] = new Growing(Type);
      for (const [name, Type] of [["t", Float64Array], ["clock", Float64Array], ["checks", Float64Array],
        ["packetEnd", Uint32Array], ["packets", Uint32Array], ["robot", Uint16Array], ["run", Uint16Array]])
        this.columns.s[name] = new Growing(Type);
      this.messageCount = 0;
      this.stepCount = 0;
      this.decisionCount = 0;
      this._received = new Growing(Uint32Array, NONE); // by message: the step that received it
      this._nextSaid = new Growing(Uint32Array, NONE); // by message: the next message received by the same step
      this._firstSaid = new Growing(Uint32Array, NONE); // by step: its first message
      this._lastSaid = new Growing(Uint32Array, NONE);
      this._rowOf = new Growing(Uint32Array, NONE); // by step: the first message sent in this step or a later one
      this._placed = 0; // the rows of steps below this are known
      this._ordinal = new Growing(Uint32Array); // by step: its number among the steps of its robot
      this._latest = new Growing(Uint32Array); // by block of messages: the latest step that received one of them
      this.ownSteps = [];
      this.decided = [];
      this.decisionAt = new Map(); // step -> its robot's decision, as text
      this.kindCounts = new Uint32Array(65536);
      this._mostKind = -1;
      this._expose();
      this.update(about);
    }

    /* Sets the present description of the run. Robots may be added later; known robots keep their numbers. */
    update(about) {
      this.about = about;
      this.robots = about.robots.map((robot) => robot.name);
      this._meet(this.robots.length - 1);
      this._conclude();
    }

    /* The known conclusions on the end of the run or epoch: the last one by robot, and all by step. */
    _conclude() {
      this.concluded = new Map();
      this.concludedIn = new Map();
      for (const { kind, robot, step, text } of this.about.notes || []) {
        const number = this.robots.indexOf(robot);
        if (kind !== "concluded" || number < 0) continue;
        const found = { robot: number, step, text: `concluded: ${text.replace(/^.*: /, "").replaceAll("-", " ")}` };
        this.concluded.set(number, found);
        this.concludedIn.set(step, found);
      }
    }

    /* The step that decided the run: that of its witness, else the last step with a conclusion; -1: unknown. */
    get deciding() {
      const { outcome } = this.about;
      const witness = outcome && outcome.witness ? this.robots.indexOf(outcome.witness) : -1;
      if (this.concluded.has(witness)) return this.concluded.get(witness).step;
      if (witness >= 0 && this.ownSteps[witness].length) return this.ownSteps[witness].all[this.ownSteps[witness].length - 1];
      return Math.max(-1, ...[...this.concluded.values()].map(({ step }) => step));
    }

    _meet(robot) {
      while (this.ownSteps.length <= robot) {
        this.ownSteps.push(new Growing(Uint32Array));
        this.decided.push({ step: new Growing(Uint32Array), text: [] });
      }
    }

    /* Whether the loaded data have robots or types that are missing in `about`. */
    get outgrown() {
      return this.ownSteps.length > this.robots.length || this._mostKind >= this.about.kinds.length;
    }

    /* The arrays for the other files. Arrays are replaced when they grow, so this is called after each growth. */
    _expose() {
      this.messages = Object.fromEntries(Object.entries(this.columns.m).map(([name, column]) => [name, column.all]));
      this.steps = Object.fromEntries(Object.entries(this.columns.s).map(([name, column]) => [name, column.all]));
      this.receivedStep = this._received.all;
      this.nextSaid = this._nextSaid.all;
      this.firstSaid = this._firstSaid.all;
      this.lastSaid = this._lastSaid.all;
      this.ordinal = this._ordinal.all;
    }

    addMessages(buffer, count) {
      let at = 0;
      for (const [name, Type] of MESSAGE) {
        this.columns.m[name].append(new Type(buffer, at, count));
        at += count * Type.BYTES_PER_ELEMENT;
      }
      const from = this.messageCount;
      const to = from + count;
      this._received.reserve(to);
      this._nextSaid.reserve(to);
      this._latest.reserve((to >> 8) + 1);
      const { step, kind } = { step: this.columns.m.step.all, kind: this.columns.m.kind.all };
      for (let m = from; m < to; m++) {
        const s = step[m];
        if (s >= this._firstSaid.all.length) for (const column of [this._firstSaid, this._lastSaid, this._rowOf]) column.reserve(s + 1);
        if (this._firstSaid.all[s] === NONE) this._firstSaid.all[s] = m;
        else this._nextSaid.all[this._lastSaid.all[s]] = m;
        this._lastSaid.all[s] = m;
        for (; this._placed <= s; this._placed++) this._rowOf.all[this._placed] = m;
        this.kindCounts[kind[m]]++;
        if (kind[m] > this._mostKind) this._mostKind = kind[m];
      }
      this.messageCount = to;
      this._expose();
    }

    addSteps(buffer, count) {
      const base = this.stepCount ? this.columns.s.packetEnd.all[this.stepCount - 1] : 0;
      let at = 0;
      const take = (name, Type, length = count) => {
        const values = new Type(buffer, at, length);
        this.columns.s[name].append(values);
        at += values.byteLength;
        return values;
      };
      take("t", Float64Array);
      take("clock", Float64Array);
      take("checks", Float64Array);
      const ends = take("packetEnd", Uint32Array);
      const packets = take("packets", Uint32Array, count ? ends[count - 1] - base : 0);
      const robots = take("robot", Uint16Array);
      take("run", Uint16Array);
      const first = this.stepCount;
      for (const column of [this._firstSaid, this._lastSaid, this._rowOf]) column.reserve(first + count);
      this._ordinal.reserve(first + count);
      let packet = 0;
      for (let i = 0; i < count; i++) {
        this._meet(robots[i]);
        const own = this.ownSteps[robots[i]];
        this._ordinal.all[first + i] = own.length;
        own.push(first + i);
        for (; packet < ends[i] - base; packet++) this._takenIn(packets[packet], first + i);
      }
      this.stepCount += count;
      this._expose();
    }

    _takenIn(message, step) {
      this._received.reserve(message + 1);
      this._received.all[message] = step;
      this._latest.reserve((message >> 8) + 1);
      if (step > this._latest.all[message >> 8]) this._latest.all[message >> 8] = step;
    }

    addDecisions(decisions) {
      for (const [step, values] of decisions) {
        const text = Object.entries(values).map(([variable, value]) => `${variable} = ${value}`).join(", ") || "no value";
        const robot = this.columns.s.robot.all[step];
        this.decisionAt.set(step, text);
        this.decided[robot].step.push(step);
        this.decided[robot].text.push(text);
      }
      this.decisionCount += decisions.length;
    }

    /* The row of a step among all messages, without filters: the row of its first message, or of the next message after it. */
    rowOf(step) {
      const row = step < this._placed ? this._rowOf.all[step] : NONE;
      return row === NONE ? this.messageCount : row;
    }

    /* The first step at message `row` or below, by binary search, since the rows of steps never decrease. */
    firstStepAt(row) {
      return row >= this.messageCount ? this._placed : lowerBound(this._rowOf.all, row, this._placed);
    }

    /* The position of a step among the steps with the same row: 1 for the last one, which usually sends that message. */
    placeOf(step) {
      const row = this.rowOf(step);
      let before = step;
      let after = step + 1;
      while (before > 0 && step - before < 32 && this.rowOf(before - 1) === row) before--;
      while (after < this.stepCount && after - step < 32 && this.rowOf(after) === row) after++;
      return (step - before + 1) / (after - before);
    }

    packetOf(step) {
      if (step >= this.stepCount) return [];
      const ends = this.steps.packetEnd;
      return this.steps.packets.subarray(step ? ends[step - 1] : 0, ends[step]);
    }

    saidIn(step) {
      const said = [];
      for (let m = step < this.firstSaid.length ? this.firstSaid[step] : NONE; m !== NONE; m = this.nextSaid[m]) said.push(m);
      return said;
    }

    causesOf(message) {
      return this.packetOf(this.messages.step[message]);
    }

    consequencesOf(message) {
      const step = this.receivedStep[message];
      return step === NONE ? [] : this.saidIn(step);
    }

    /* The number of `robot`'s last step up to `step`; -1: it has not started. */
    ownStepAt(robot, step) {
      const own = this.ownSteps[robot];
      return lowerBound(own.all, step + 1, own.length) - 1;
    }

    valueAt(robot, step) {
      const { step: steps, text } = this.decided[robot];
      return text[lowerBound(steps.all, step + 1, steps.length) - 1] || "";
    }

    /* Messages sent before `message` and received at `step` or later, whose arrows pass; at most `limit`, nearest first. */
    passing(message, step, limit) {
      const found = [];
      const latest = this._latest.all;
      let looked = 0; // a few arrows in each block of a long run must not make a frame slow
      for (let block = (message - 1) >> 8; block >= 0 && message > 0; block--) {
        if (latest[block] < step) continue;
        if (++looked > 400) break;
        for (let m = Math.min(message, (block + 1) * BLOCK) - 1; m >= block * BLOCK; m--)
          if (this.receivedStep[m] !== NONE && this.receivedStep[m] >= step && found.push(m) >= limit) return found;
      }
      return found;
    }

    nameOf(robot) {
      return this.robots[robot] || `robot ${robot}`;
    }

    kindOf(message) {
      return this.about.kinds[this.messages.kind[message]] || { name: "?", performative: "?", why: "" };
    }

    runOf(message) {
      return this.about.runs[this.messages.run[message]];
    }
  };
})();
