// A table of pairs of values. Each cell is a toggle button. Arrow keys move between cells, and to the headings, which set
// a complete row or column. With Shift, all cells from the last one to this one are set. Of a large table, only a part is
// shown, which can be moved.
const WHOLE = 40, PART = 16;
const STEPS = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1], PageUp: [-PART, 0], PageDown: [PART, 0] };
const clamp = (value, least, most) => Math.max(least, Math.min(most, value));

export default {
  template: `
    <div class="pairs">
      <p class="soft small">{{ words.caption.replace('{one}', one).replace('{other}', other) }} {{ words.many }}</p>
      <div v-if="part < count" class="ranges">
        <div v-for="(way, axis) in [words.down, words.across]" role="group" :aria-label="way">
          <span class="soft small">{{ range(axis) }}</span>
          <button type="button" :disabled="!from[axis]" :aria-label="way + ': ' + words.back" @click="shift(axis, -part)">−</button>
          <button type="button" :disabled="from[axis] >= count - part" :aria-label="way + ': ' + words.on" @click="shift(axis, part)">+</button>
        </div>
      </div>
      <div class="scroll"><table @keydown="typed">
        <thead><tr><td></td><th v-for="j in shown(1)" scope="col"><button type="button" class="head" tabindex="-1" :data-at="'-1:' + j"
          :aria-label="words.column.replace('{value}', labels[j])" @focus="at = [-1, j]" @click="line(-1, j)">{{ labels[j] }}</button></th></tr></thead>
        <tbody><tr v-for="i in shown(0)"><th scope="row"><button type="button" class="head" tabindex="-1" :data-at="i + ':-1'"
          :aria-label="words.row.replace('{value}', labels[i])" @focus="at = [i, -1]" @click="line(i, -1)">{{ labels[i] }}</button></th>
          <td v-for="j in shown(1)"><button type="button" :aria-pressed="fits.has(i * count + j)" :data-at="i + ':' + j"
            :aria-label="words.pair.replace('{one}', labels[i]).replace('{other}', labels[j])"
            :tabindex="i === stop[0] && j === stop[1] ? 0 : -1" @focus="at = [i, j]" @click="pressed(i, j, $event)"></button></td>
        </tr></tbody>
      </table></div>
      <p v-if="wrong" class="error small" role="alert">{{ wrong }}</p>
    </div>`,
  props: { labels: Array, on: Array, count: Number, one: String, other: String, words: Object, wrong: String },
  emits: ["filled"],
  data: () => ({ at: [0, 0], from: [0, 0], last: null }),
  watch: {
    count() {
      [this.at, this.from, this.last] = [[0, 0], [0, 0], null];
    },
  },
  computed: {
    fits() {
      return new Set(this.on);
    },
    part() {
      return this.count <= WHOLE ? this.count : PART;
    },
    // The button in the tab order: the last one with the focus, or else the first one shown.
    stop() {
      return this.at.map((place, axis) => clamp(place, this.from[axis], this.from[axis] + this.part - 1));
    },
  },
  methods: {
    shown(axis) {
      return [...Array(Math.min(this.part, this.count - this.from[axis])).keys()].map((step) => this.from[axis] + step);
    },
    range(axis) {
      const [first, last] = [this.from[axis], Math.min(this.from[axis] + this.part, this.count) - 1];
      return this.words.range.replace("{way}", [this.words.down, this.words.across][axis])
        .replace("{first}", this.labels[first]).replace("{last}", this.labels[last]).replace("{count}", this.count);
    },
    shift(axis, by) {
      this.from[axis] = clamp(this.from[axis] + by, 0, this.count - this.part);
    },
    // The state of the last button is stored here, since users type faster than the server answers.
    pressed(i, j, event) {
      const [a, b, on] = event.shiftKey && this.last ? this.last : [i, j, !this.fits.has(i * this.count + j)];
      this.last = [i, j, on];
      this.$emit("filled", [Math.min(a, i), Math.min(b, j), Math.max(a, i), Math.max(b, j), on]);
    },
    line(i, j) {
      const all = [...Array(this.count).keys()];
      const on = !all.every((k) => this.fits.has(i < 0 ? k * this.count + j : i * this.count + k));
      this.$emit("filled", i < 0 ? [0, j, this.count - 1, j, on] : [i, 0, i, this.count - 1, on]);
    },
    typed(event) {
      const ends = { Home: [this.at[0], 0], End: [this.at[0], this.count - 1] }[event.key];
      const step = STEPS[event.key];
      if (!step && !ends) return;
      event.preventDefault();
      const least = event.key.startsWith("Arrow") ? -1 : 0;
      const to = ends || this.at.map((place, axis) => clamp(place + step[axis], least, this.count - 1));
      if (to[0] < 0 && to[1] < 0) return;
      to.forEach((place, axis) => {
        if (place < 0) return;
        if (place < this.from[axis]) this.from[axis] = place;
        if (place >= this.from[axis] + this.part) this.from[axis] = place - this.part + 1;
      });
      this.at = to;
      this.$nextTick(() => this.$el.querySelector(`[data-at="${to[0]}:${to[1]}"]`)?.focus());
    },
  },
};
