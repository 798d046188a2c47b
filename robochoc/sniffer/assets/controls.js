"use strict";
/* The actions of all buttons, lists and keys of the page. */
(() => {
  const byId = (id) => document.getElementById(id);

  Sniffer.controls = (page) => {
    byId("counters").addEventListener("moment", (event) => page.time.go(event.detail));
    const { view, chart } = page;
    page.showUpper = Sniffer.tabs(byId("upper").querySelector("[role=tablist]"), (upper) => view.set({ upper }));
    const lower = Sniffer.tabs(byId("lower").querySelector("[role=tablist]"), (id) => {
      document.body.classList.remove("folded");
      view.set({ lower: id });
      page.showLower(id);
    });
    Sniffer.tabs(byId("left").querySelector("[role=tablist]"));
    page.showUpper(view.upper);
    lower(view.lower);
    page.slowSearch = Sniffer.seldom(500, () => page.search.find(view.query));
    for (const input of document.querySelectorAll("[name=layout]")) input.addEventListener("change", () => view.set({ layout: input.value }));
    byId("colour").addEventListener("change", (event) => view.set({ colourBy: event.target.value }));
    byId("arrows").addEventListener("change", (event) => view.set({ arrows: event.target.value }));
    const query = byId("query");
    const find = Sniffer.seldom(200, () => view.set({ query: query.value }));
    query.addEventListener("input", () => {
      page.awaited = 0;
      find();
    });
    byId("find").addEventListener("submit", (event) => event.preventDefault());
    query.addEventListener("keydown", (event) => {
      if (event.key === "Enter") page.hit(event.shiftKey ? -1 : 1);
    });
    const focus = () => byId("grid").focus({ preventScroll: true });
    const press = { "hit-back": () => page.hit(-1), "hit-on": () => page.hit(1), live: () => view.set({ follow: !view.follow }), skip: focus,
      verdict: () => page.decided(),
      "zoom-in": () => chart.zoom(1.25), "zoom-out": () => chart.zoom(0.8), wider: () => chart.widen(1.25), narrower: () => chart.widen(0.8),
      fit: () => chart.fit() };
    for (const [id, does] of Object.entries(press)) byId(id).addEventListener("click", does);
    menu(byId("display"));
    keys(page, focus);
  };

  /* Closes by a click elsewhere, and by Escape. */
  const menu = (details) => {
    document.addEventListener("click", (event) => {
      if (!details.contains(event.target)) details.open = false;
    });
    details.addEventListener("keydown", (event) => {
      if (event.key !== "Escape" || !details.open) return;
      event.stopPropagation();
      details.open = false;
      details.querySelector("summary").focus();
    });
  };

  const keys = (page, focus) => {
    const { view, chart, time, model } = page;
    const next = () => page.move(1);
    const before = () => page.move(-1);
    Sniffer.keys({
      ArrowDown: next, j: next, ArrowUp: before, k: before,
      PageDown: () => page.move(Math.floor(chart.shape.rowsInWindow) - 1), PageUp: () => page.move(1 - Math.floor(chart.shape.rowsInWindow)),
      Home: () => page.move(-Infinity), End: () => page.move(Infinity),
      ArrowRight: () => time.step(1, -1), ArrowLeft: () => time.step(-1, -1),
      "]": () => time.step(1, view.robot), "[": () => time.step(-1, view.robot),
      ".": () => time.change(1), ",": () => time.change(-1),
      p: () => time.play(), f: () => view.set({ follow: !model.about.over && !view.follow }),
      "/": () => byId("query").select(), n: () => page.hit(1), N: () => page.hit(-1),
      c: () => page.cause((m) => model.causesOf(m)), v: () => page.cause((m) => model.consequencesOf(m)),
      r: () => view.selected >= 0 && page.robot(model.messages.sender[view.selected]),
      "+": () => chart.zoom(1.25), "-": () => chart.zoom(0.8), "?": () => byId("help").showModal(),
      Enter: () => {
        page.windows.right(true);
        view.set({ upper: "message" });
        page.showUpper("message");
        byId("message").focus();
      },
      Escape: (event) => {
        if (document.querySelector("dialog[open]")) return;
        if (page.windows.narrow()) ["left", "right"].forEach((side) => page.windows[side](false));
        if (event.target === byId("grid") || event.target === document.body) view.set({ selected: -1, robot: -1 });
        focus();
      },
    });
  };
})();
