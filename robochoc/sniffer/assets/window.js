"use strict";
/* The parts of the window: foldable sides, the height of the table, light and dark theme. */
(() => {
  const NARROW = matchMedia("(max-width: 60rem)");

  const remembered = (name, value) => {
    try {
      if (value === undefined) return localStorage.getItem(`sniffer-${name}`);
      localStorage.setItem(`sniffer-${name}`, value);
    } catch {
      /* pages from files, or without storage, do not save it */
    }
    return null;
  };

  const side = (name) => {
    const button = Sniffer.byId(`show-${name}`);
    const show = (wanted) => {
      document.body.classList.toggle(`no-${name}`, !wanted);
      button.setAttribute("aria-expanded", String(wanted));
      if (wanted && NARROW.matches) document.body.classList.add(`no-${name === "left" ? "right" : "left"}`);
    };
    button.addEventListener("click", () => {
      show(document.body.classList.contains(`no-${name}`));
      for (const other of ["left", "right"])
        Sniffer.byId(`show-${other}`).setAttribute("aria-expanded", String(!document.body.classList.contains(`no-${other}`)));
    });
    show(!NARROW.matches);
    return show;
  };

  const splitter = () => {
    const element = Sniffer.byId("splitter");
    const centre = Sniffer.byId("centre");
    const set = (part) => {
      const percent = Math.round(Math.min(Math.max(part, 10), 90));
      centre.style.setProperty("--table", `${percent}%`);
      element.setAttribute("aria-valuenow", String(percent));
    };
    element.addEventListener("pointerdown", (event) => {
      element.setPointerCapture(event.pointerId);
      const move = (now) => {
        const box = centre.getBoundingClientRect();
        set(((box.bottom - now.clientY) / box.height) * 100);
      };
      element.addEventListener("pointermove", move);
      element.addEventListener("pointerup", () => element.removeEventListener("pointermove", move), { once: true });
    });
    element.addEventListener("keydown", (event) => {
      const step = { ArrowUp: 5, ArrowDown: -5 }[event.key];
      if (!step) return;
      event.preventDefault();
      set(Number(element.getAttribute("aria-valuenow")) + step);
    });
  };

  const theme = (changed) => {
    const { palette } = Sniffer;
    const stored = remembered("theme");
    if (stored === "light" || stored === "dark") palette.theme = stored;
    const apply = () => {
      palette.apply();
      changed();
    };
    const button = Sniffer.byId("theme");
    button.addEventListener("click", () => {
      palette.theme = palette.dark ? "light" : "dark";
      remembered("theme", palette.theme);
      apply();
      Sniffer.say(`The page is now ${palette.theme}`);
    });
    palette.watch(apply);
    palette.apply();
  };

  Sniffer.frame = (changed) => {
    theme(changed);
    splitter();
    const fold = Sniffer.byId("fold");
    if (NARROW.matches) document.body.classList.add("folded");
    fold.setAttribute("aria-expanded", String(!NARROW.matches));
    fold.addEventListener("click", () => {
      const folded = document.body.classList.toggle("folded");
      fold.setAttribute("aria-expanded", String(!folded));
    });
    return { left: side("left"), right: side("right"), narrow: () => NARROW.matches };
  };
})();
