"use strict";
/* Time: the slider, steps forward and back, and play. The moment is a step; the page shows the state after it. */
(() => {
  Sniffer.Time = class {
    constructor(model, view) {
      Object.assign(this, { model, view, playing: 0 });
      this.slider = Sniffer.byId("moment");
      this.slider.addEventListener("input", () => this.go(Number(this.slider.value)));
      const press = { first: () => this.go(0), last: () => this.go(Infinity), back: () => this.step(-1), on: () => this.step(1),
        play: () => this.play() };
      for (const [id, does] of Object.entries(press)) Sniffer.byId(id).addEventListener("click", does);
      this.whose = Sniffer.byId("whose");
      this.whose.addEventListener("change", () => {
        if (this.whose.value === "one" && view.robot < 0) {
          this.whose.value = "all";
          return Sniffer.say("Choose a robot first: click its name");
        }
        return view.set({ whose: this.whose.value });
      });
      this.speed = Sniffer.byId("speed");
    }

    go(step) {
      const last = Math.max(this.model.stepCount - 1, 0);
      this.touched = true; // from now on, the moment does not follow the end of the run
      this.view.set({ moment: Math.min(Math.max(step, 0), last), follow: false });
      this.moved = true;
    }

    /* The next step, of all robots or of one. */
    step(by, robot = this.view.whose === "one" ? this.view.robot : -1) {
      const { model, view } = this;
      if (robot < 0) return this.go(view.moment + by);
      const own = model.ownStepAt(robot, view.moment);
      const steps = model.ownSteps[robot];
      const there = own >= 0 && steps.all[own] === view.moment;
      const to = by > 0 || there ? own + by : own;
      if (to < 0 || to >= steps.length) return Sniffer.say(`${model.nameOf(robot)} has no further step`);
      return this.go(steps.all[to]);
    }

    /* The next or previous change of the chosen robot's value. */
    change(by) {
      const { model, view } = this;
      if (view.robot < 0) return Sniffer.say("Choose a robot first: click its name");
      const { step } = model.decided[view.robot];
      const at = Sniffer.lowerBound(step.all, view.moment + (by > 0 ? 1 : 0), step.length) - (by > 0 ? 0 : 1);
      if (at < 0 || at >= step.length) return Sniffer.say(`${model.nameOf(view.robot)} has no further change of value`);
      return this.go(step.all[at]);
    }

    play() {
      if (this.playing) return this.pause();
      if (this.view.moment >= this.model.stepCount - 1) this.go(0);
      this._button("pause", "Pause");
      let owed = 0;
      let before = performance.now();
      const tick = (now) => {
        owed += ((now - before) / 1000) * Number(this.speed.value);
        before = now;
        const steps = Math.floor(owed);
        owed -= steps;
        if (steps && this.view.whose === "one") for (let i = 0; i < steps; i++) this.step(1);
        else if (steps) this.go(this.view.moment + steps);
        const over = this.view.moment >= this.model.stepCount - 1;
        const none = this.view.whose === "one" && this.model.ownStepAt(this.view.robot, this.view.moment) >= this.model.ownSteps[this.view.robot].length - 1;
        if (over || none) return this.pause();
        this.playing = requestAnimationFrame(tick);
        return undefined;
      };
      this.playing = requestAnimationFrame(tick);
      return undefined;
    }

    pause() {
      cancelAnimationFrame(this.playing);
      this.playing = 0;
      this._button("play", "Play");
    }

    _button(icon, label) {
      const button = Sniffer.byId("play");
      Sniffer.icon(button, icon);
      button.setAttribute("aria-label", label);
      button.title = `${label} (p)`;
    }

    paint() {
      const { model, view, slider } = this;
      const last = Math.max(model.stepCount - 1, 0);
      slider.max = String(last);
      if (document.activeElement !== slider || Number(slider.value) !== view.moment) slider.value = String(view.moment);
      slider.style.setProperty("--part", `${last ? (view.moment / last) * 100 : 0}%`);
      slider.disabled = !model.stepCount;
      const t = model.stepCount ? Sniffer.moment(model.steps.t[Math.min(view.moment, last)]) : "";
      const robot = model.stepCount ? model.nameOf(model.steps.robot[view.moment]) : "";
      const text = model.stepCount ? `step ${Sniffer.count(view.moment + 1)} of ${Sniffer.count(model.stepCount)}` : "nothing yet";
      const hint = model.stepCount > 1 && !view.moment && !this.touched && !view.follow ? " · press p to play" : "";
      slider.setAttribute("aria-valuetext", `${text}, t = ${t}, ${robot}`);
      Sniffer.fill(Sniffer.byId("when"), Sniffer.make("b", {}, text), Sniffer.make("span", {}, model.stepCount ? ` t = ${t} · ${robot}${hint}` : ""));
      if (this.whose.value !== view.whose) this.whose.value = view.whose;
    }
  };
})();
