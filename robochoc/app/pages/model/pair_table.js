// A table of values by values. Each cell is a button that is pressed or not; arrow keys go from one to the next.
export default {
  template: `
    <div class="pairs">
      <p class="soft small">{{ words.caption.replace('{one}', one).replace('{other}', other) }}</p>
      <p v-if="large" class="soft small">{{ large }}</p>
      <div class="scroll"><table @keydown="typed">
        <thead><tr><td></td><th v-for="label in labels" scope="col">{{ label }}</th></tr></thead>
        <tbody><tr v-for="(label, i) in labels"><th scope="row">{{ label }}</th>
          <td v-for="(other, j) in labels"><button type="button" :aria-pressed="fits.has(i * count + j)" :data-at="i + ':' + j"
            :aria-label="words.pair.replace('{one}', label).replace('{other}', other)"
            :tabindex="i === at[0] && j === at[1] ? 0 : -1" @focus="at = [i, j]" @click="$emit('toggled', [i, j])"></button></td>
        </tr></tbody>
      </table></div>
    </div>`,
  props: { labels: Array, on: Array, count: Number, one: String, other: String, words: Object, large: String },
  emits: ["toggled"],
  data: () => ({ at: [0, 0] }),
  computed: {
    fits() {
      return new Set(this.on);
    },
  },
  methods: {
    typed(event) {
      const step = { ArrowUp: [-1, 0], ArrowDown: [1, 0], ArrowLeft: [0, -1], ArrowRight: [0, 1] }[event.key];
      if (!step) return;
      event.preventDefault();
      this.$el.querySelector(`[data-at="${this.at[0] + step[0]}:${this.at[1] + step[1]}"]`)?.focus();
    },
  },
};
