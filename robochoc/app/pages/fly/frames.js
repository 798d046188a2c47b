// The flight and the conversation, each as a page in a frame, with a common time line: for each epoch, the conversation
// and then the flight. The times of the pages are read and set here, so that moving one page moves the other.
const TALK = { least: 3, most: 10, perStep: 0.15 }; // the playing time of a conversation, in seconds
const LOOK_MS = 120;
const SPEEDS = [0.5, 1, 2, 4];

// The parts of the time line, in order. `steps`: the range of steps of the conversation (from, upto); `times`: that of the
// flight. Without a flight, or without a conversation, there are only parts of the other one.
export function partsOf(runs, stepCount, chapters, duration) {
  const starts = [];
  for (const run of runs) {
    const epoch = run.epoch ?? 0;
    if (!starts.length || starts.at(-1).epoch !== epoch) starts.push({ epoch, step: run.step });
  }
  if (starts.length) starts[0].step = 0;
  const begins = chapters.map((chapter, number) => (number ? chapter.at : 0)); // the drones stand for a while before the first chapter
  // If the epochs of the pages differ, the complete conversation is first, followed by the complete flight.
  const fits = stepCount && starts.length === begins.length;
  const talks = !stepCount ? [] : fits ? starts.map((one) => one.step) : [0];
  const flights = !duration ? [] : fits ? begins : [0];
  const parts = [];
  let at = 0;
  const add = (part, long) => {
    parts.push({ ...part, begins: at, ends: at + long });
    at += long;
  };
  for (let epoch = 0; epoch < Math.max(talks.length, flights.length); epoch++) {
    const from = talks[epoch] ?? 0;
    const upto = Math.max((talks[epoch + 1] ?? stepCount) - 1, from);
    const start = flights[epoch] ?? 0;
    if (epoch < talks.length) {
      const long = Math.min(Math.max((upto - from + 1) * TALK.perStep, TALK.least), TALK.most);
      add({ kind: "talk", epoch, from, upto, time: epoch < flights.length ? start : duration }, long);
    }
    if (epoch < flights.length) {
      const end = flights[epoch + 1] ?? duration;
      if (end > start) add({ kind: "fly", epoch, from: start, upto: end, step: talks.length ? upto : -1 }, end - start);
    }
  }
  return parts;
}

export default {
  template: `
    <div class="stage" :data-ready="ready">
      <div v-if="parts.length" class="stage-line panel" role="group" :aria-label="words.label">
        <button type="button" class="stage-play" :aria-label="playing ? words.pause : words.play" :title="playing ? words.pause : words.play" @click="toggle">
          <svg viewBox="0 0 16 16" aria-hidden="true"><path v-if="playing" d="M3 2h3.6v12H3zM9.4 2H13v12H9.4z"/><path v-else d="M4 2.2v11.6a.6.6 0 0 0 .9.5l9.4-5.8a.6.6 0 0 0 0-1L4.9 1.7a.6.6 0 0 0-.9.5z"/></svg>
        </button>
        <div class="stage-track">
          <div class="stage-parts" aria-hidden="true">
            <span v-for="part in parts" :key="part.begins" :class="'part-' + part.kind" :style="{ flexGrow: part.ends - part.begins }">{{ named(part) }}</span>
          </div>
          <input type="range" min="0" :max="duration" step="any" :value="time" :aria-label="words.label" :aria-valuetext="told" @input="go(Number($event.target.value))" @keydown="key">
        </div>
        <output>{{ told }}</output>
        <label class="stage-speed">{{ words.speed }}
          <select v-model.number="speed"><option v-for="one in speeds" :key="one" :value="one">{{ one }}×</option></select></label>
      </div>
      <p v-else-if="(flight || talk) && !ready" class="soft">{{ words.waiting }}</p>
      <div class="stage-views" :data-both="flies && talks">
        <figure v-if="flies"><figcaption>{{ words.flight }}</figcaption>
          <iframe v-if="flight" ref="flight" :src="flight" :title="words.flight" @load="meet"></iframe><div v-else class="stage-empty"></div></figure>
        <figure v-if="talks"><figcaption>{{ words.conversation }}</figcaption>
          <iframe v-if="talk" ref="talk" :src="talk" :title="words.conversation" @load="meet"></iframe><div v-else class="stage-empty"></div></figure>
      </div>
    </div>`,
  // The addresses of existing pages, and whether pages are expected.
  props: { flight: String, talk: String, flies: Boolean, talks: Boolean, words: Object },
  data() {
    return { parts: [], time: 0, playing: false, speed: 1, speeds: SPEEDS, ready: false };
  },
  computed: {
    duration() {
      return this.parts.length ? this.parts.at(-1).ends : 0;
    },
    part() {
      return this.parts.findLast((part) => part.begins <= this.time + 1e-6) ?? this.parts[0];
    },
    told() {
      const { part, words } = this;
      if (!part) return "";
      const within = this.time - part.begins;
      if (part.kind === "fly") return words.seconds.replace("{seconds}", (part.from + within).toFixed(1));
      return words.step.replace("{step}", this.stepAt(part) + 1).replace("{steps}", this.steps);
    },
  },
  mounted() {
    this.asked = Number(new URLSearchParams(location.hash.slice(1)).get("t")) || 0;
    this.looking = setInterval(() => this.meet(), LOOK_MS);
  },
  unmounted() {
    clearInterval(this.looking);
    cancelAnimationFrame(this.frame);
  },
  methods: {
    // Objects of the pages, which have the same origin. They exist when the scripts of the pages have run.
    scene() {
      try {
        return this.$refs.flight?.contentWindow?.Playback;
      } catch {
        return undefined; // an error page of the browser, since the server has ended
      }
    },
    sniffer() {
      try {
        const page = this.$refs.talk?.contentWindow?.Sniffer?.page;
        return page && page.model.stepCount >= page.model.about.steps ? page : undefined;
      } catch {
        return undefined;
      }
    },
    // Connects newly loaded pages; each adds its part of the time line.
    meet() {
      const [scene, page] = [this.scene(), this.sniffer()];
      if (scene === this.known?.scene && page === this.known?.page) return;
      const flown = this.flown();
      this.known = { scene, page };
      const playback = scene ? JSON.parse(this.$refs.flight.contentDocument.getElementById("playback").textContent) : {};
      this.steps = page ? page.model.stepCount : 0;
      this.parts = partsOf(page ? page.model.about.runs : [], this.steps, playback.chapters ?? [], playback.duration ?? 0);
      if (scene && !scene.heard) this.hear(scene);
      if (page && !page.heard) {
        page.heard = true;
        this.take(this.$refs.talk, "p");
        page.view.on((changed) => changed.has("moment") && this.fromTalk(page));
      }
      this.ready = Boolean((scene || !this.flies) && (page || !this.talks));
      this.go(this.again(flown) ?? Math.min(this.asked, this.duration));
    },
    // A moment of the flight, chosen by the user.
    flown() {
      const { part, time } = this;
      const began = Math.min(this.asked, this.duration);
      return part?.kind === "fly" && time !== began ? part.from + time - part.begins : undefined;
    },
    // The position of this moment on the time line, which has changed when the conversation was loaded.
    again(flown) {
      const part = flown !== undefined && this.parts.findLast((one) => one.kind === "fly" && one.from <= flown);
      return part ? part.begins + flown - part.from : undefined;
    },
    hear(scene) {
      scene.heard = true;
      this.take(this.$refs.flight, " ");
      const shown = scene.player.ontime;
      scene.player.pause();
      scene.player.ontime = (time) => {
        shown(time);
        if (!this.moving) this.fromFlight(time);
      };
    },
    // The key that plays a single page plays both pages.
    take(frame, key) {
      frame.contentWindow.addEventListener("keydown", (event) => {
        if (event.key !== key || event.ctrlKey || event.altKey || event.metaKey || event.target.closest?.("input, select, textarea, button, summary")) return;
        event.preventDefault();
        event.stopImmediatePropagation();
        this.toggle();
      }, true);
    },
    stepAt(part) {
      const share = (this.time - part.begins) / (part.ends - part.begins);
      return Math.min(part.from + Math.floor(share * (part.upto - part.from + 1)), part.upto);
    },
    // Sets the time, also of both pages.
    go(time) {
      this.time = Math.min(Math.max(time, 0), this.duration);
      const { part } = this;
      if (!part) return;
      const fly = part.kind === "fly";
      this.show(fly ? part.step : this.stepAt(part), fly ? part.from + this.time - part.begins : part.time);
    },
    show(step, time) {
      const { scene, page } = this.known;
      this.moving = true;
      if (scene && Math.abs(scene.player.time - time) > 1e-6) scene.player.seek(time);
      if (scene?.player.playing) scene.player.pause();
      if (page && step >= 0 && page.view.moment !== step) page.time.go(step);
      this.step = step;
      this.moving = false;
    },
    fromFlight(time) {
      const part = this.parts.findLast((one) => one.kind === "fly" && one.from <= time + 1e-6);
      if (!part) return;
      this.rest();
      this.time = part.begins + Math.min(time, part.upto) - part.from;
      const { page } = this.known;
      if (page && part.step >= 0 && page.view.moment !== part.step) page.time.go((this.step = part.step));
    },
    fromTalk(page) {
      const { moment } = page.view;
      if (moment === this.step) return; // the step was set by this script
      const part = this.parts.find((one) => one.kind === "talk" && one.from <= moment && moment <= one.upto);
      if (!part) return;
      this.rest();
      this.step = moment;
      this.time = part.begins + ((moment - part.from + 0.5) / (part.upto - part.from + 1)) * (part.ends - part.begins);
      const { scene } = this.known;
      this.moving = true;
      if (scene?.player.playing) scene.player.pause();
      if (scene && Math.abs(scene.player.time - part.time) > 1e-6) scene.player.seek(part.time);
      this.moving = false;
    },
    toggle() {
      if (this.playing) this.rest();
      else this.play();
    },
    rest() {
      this.playing = false;
      cancelAnimationFrame(this.frame);
    },
    play() {
      if (this.time >= this.duration - 1e-6) this.go(0);
      this.playing = true;
      let before = performance.now();
      const tick = (now) => {
        if (!this.playing) return;
        this.go(this.time + (Math.min(Math.max(now - before, 0), 500) / 1000) * this.speed);
        before = now;
        if (this.time >= this.duration - 1e-6) this.rest();
        else this.frame = requestAnimationFrame(tick);
      };
      this.frame = requestAnimationFrame(tick);
    },
    key(event) {
      const by = { ArrowLeft: -1, ArrowRight: 1, ArrowDown: -1, ArrowUp: 1 }[event.key];
      if (event.key === " ") this.toggle();
      else if (by) this.go(this.next(by));
      else return;
      event.preventDefault();
    },
    // Moves by a step of the conversation, or by a tenth of a second of the flight.
    next(by) {
      const { part } = this;
      return this.time + by * (part.kind === "fly" ? 0.1 : (part.ends - part.begins) / (part.upto - part.from + 1));
    },
    named(part) {
      const name = part.kind === "fly" ? this.words.flies : this.words.talks;
      const epochs = this.parts.some((one) => one.epoch > 0);
      return epochs ? `${name}, ${this.words.epoch.replace("{number}", part.epoch)}` : name;
    },
    // Returns the address of the present moment.
    link(address) {
      const url = new URL(address, location.href);
      url.hash = `t=${this.time.toFixed(2)}`;
      return url.href;
    },
  },
};
