// Light or dark: the browser's preference, unless the user chooses otherwise. The choice is stored in the browser.
const KEY = "robochoc-theme";

export default {
  template: `
    <q-btn flat round dense icon="contrast" :aria-label="says" :aria-pressed="$q.dark.isActive" @click="turn">
      <q-tooltip>{{ says }}</q-tooltip>
    </q-btn>`,
  props: { says: String },
  mounted() {
    this.follow();
    window.addEventListener("storage", this.heard);
  },
  unmounted() {
    window.removeEventListener("storage", this.heard);
  },
  methods: {
    follow() {
      let kept = null;
      try {
        kept = localStorage.getItem(KEY);
      } catch { /* the browser does not store it */ }
      if (kept === "dark" || kept === "light") this.show(kept === "dark");
    },
    heard(event) {
      if (event.key === KEY) this.follow();
    },
    show(dark) {
      this.$q.dark.set(dark);
      document.getElementById("nicegui-color-scheme")?.setAttribute("content", dark ? "dark" : "light");
    },
    turn() {
      const dark = !this.$q.dark.isActive;
      this.show(dark);
      try {
        localStorage.setItem(KEY, dark ? "dark" : "light");
      } catch { /* then the choice is only for this page */ }
    },
  },
};
