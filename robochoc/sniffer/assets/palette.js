"use strict";
/* Colours. Types of messages differ in hue, lightness and dash, so that colour-blind readers can distinguish them. As
   text, each colour has a contrast of at least 4.5 on the background of its theme. */
(() => {
  const LIGHT = ["#0a5fb8", "#b03a06", "#00714a", "#8a359c", "#6f5a00", "#006c80", "#b01f63", "#4b5763"];
  const DARK = ["#7fb9ff", "#ffa06b", "#56d6a6", "#dba6f3", "#e8cb55", "#66d6e8", "#ff97c4", "#b9c4cf"];
  const DASHES = [[], [7, 3], [2, 3], [9, 3, 2, 3], [4, 4], [12, 4], [1, 4], [6, 2, 2, 2, 2, 2]];

  const THEMES = {
    light: { paper: "#ffffff", band: "#f4f6f9", ink: "#17202b", soft: "#55606d", line: "#c3cbd5", others: "#8b95a1",
      box: "#dfe6ef", rim: "#8d9aab", chosen: "#1f5fd0", glow: "#1f5fd022", later: "#ffffff8c", pill: "#fff7d6",
      pillRim: "#b79b2a", pillInk: "#4a3d00", hit: "#e0a100", lost: "#b3261e", now: "#d0247a" },
    dark: { paper: "#11171f", band: "#161d27", ink: "#e9eff6", soft: "#a3b0bf", line: "#364250", others: "#6b7785",
      box: "#2b3644", rim: "#6d7d90", chosen: "#8ab6ff", glow: "#8ab6ff26", later: "#11171f80", pill: "#3a3212",
      pillRim: "#bfa23a", pillInk: "#ffe9a3", hit: "#ffc53d", lost: "#ff8a80", now: "#ff7ab8" },
  };
  const outside = matchMedia("(prefers-color-scheme: dark)");

  Sniffer.palette = {
    theme: "auto", // auto: the setting of the system
    get dark() {
      return this.theme === "auto" ? outside.matches : this.theme === "dark";
    },
    get paint() {
      return THEMES[this.dark ? "dark" : "light"];
    },
    colour(index) {
      const colours = this.dark ? DARK : LIGHT;
      return colours[index % colours.length];
    },
    count: LIGHT.length, // after this number, colours are repeated
    dash: (index) => DASHES[index % DASHES.length],
    apply() {
      document.documentElement.dataset.theme = this.dark ? "dark" : "light";
    },
    watch(changed) {
      outside.addEventListener("change", changed);
    },
  };

  /* The colour of a message; `by`: kind, performative, run or sender. Colours are the same in the whole page. */
  Sniffer.colouring = (model, by) => {
    const { messages, about } = model;
    if (by === "run") return (m) => messages.run[m];
    if (by === "sender") return (m) => messages.sender[m];
    if (by === "performative") {
      const names = [...new Set(about.kinds.map((kind) => kind.performative))];
      const places = about.kinds.map((kind) => names.indexOf(kind.performative));
      return (m) => places[messages.kind[m]] || 0;
    }
    return (m) => messages.kind[m];
  };
})();
