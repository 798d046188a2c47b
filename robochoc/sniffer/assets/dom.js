"use strict";
/* Common functions: elements with plain text, readable numbers, tabs. */
(() => {
  Sniffer.byId = (id) => document.getElementById(id);

  /* Creates an element. Items of `children` that are not elements become text, so data never becomes markup. */
  Sniffer.make = (name, properties = {}, ...children) => {
    const element = document.createElement(name);
    for (const [key, value] of Object.entries(properties)) {
      if (value === undefined || value === null) continue;
      if (key.startsWith("on")) element.addEventListener(key.slice(2), value);
      else if (key === "class") element.className = value;
      else if (key in element && key !== "list" && key !== "role") element[key] = value;
      else element.setAttribute(key, value);
    }
    element.append(...children.filter((child) => child !== null && child !== undefined));
    return element;
  };

  /* Replaces only the changed children, so that live news do not close elements that the user has opened. */
  Sniffer.fill = (element, ...children) => {
    element.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
    return element;
  };

  /* The parts of a sentence for an element; names between backticks become code. */
  Sniffer.coded = (text) => String(text).split("`").map((part, at) => (at % 2 ? Sniffer.make("code", {}, part) : part));
  Sniffer.uncoded = (text) => String(text).replaceAll("`", "");

  const whole = new Intl.NumberFormat("en");
  Sniffer.count = (number) => whole.format(number);
  Sniffer.many = (number, one, several = one + "s") => `${whole.format(number)} ${number === 1 ? one : several}`;

  /* Seconds with a precision that distinguishes neighbouring events; simulated steps are integers. */
  Sniffer.moment = (t) => {
    if (!Number.isFinite(t)) return "";
    return Number.isInteger(t) ? whole.format(t) : t < 10 ? t.toFixed(4) : t < 1000 ? t.toFixed(3) : t.toFixed(1);
  };

  /* Announces a text to screen readers. Repeated news are announced only from time to time. */
  let spoken = 0;
  Sniffer.say = (text, seldom = false) => {
    const now = performance.now();
    if (seldom && now - spoken < 5000) return;
    spoken = now;
    Sniffer.byId("said").textContent = text;
  };

  /* Runs `action` at most every `ms`, with the latest arguments, and once more after the last call. */
  Sniffer.seldom = (ms, action) => {
    let last = null;
    return (...all) => {
      if (!last) setTimeout(() => {
        const said = last;
        last = null;
        action(...said);
      }, ms);
      last = all;
    };
  };

  Sniffer.icon = (button, name) => button.querySelector("use").setAttribute("href", "#i-" + name);

  /* A tab list according to ARIA's authoring practices: arrow keys move, and only the chosen tab is in the tab order. */
  Sniffer.tabs = (list, chosen) => {
    const tabs = [...list.querySelectorAll("[role=tab]")];
    const choose = (tab, tell = true) => {
      for (const other of tabs) {
        const own = other === tab;
        other.setAttribute("aria-selected", String(own));
        other.tabIndex = own ? 0 : -1;
        Sniffer.byId(other.getAttribute("aria-controls")).hidden = !own;
      }
      if (chosen && tell) chosen(tab.getAttribute("aria-controls"));
    };
    for (const tab of tabs) tab.addEventListener("click", () => choose(tab));
    list.addEventListener("keydown", (event) => {
      const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      const at = tabs.indexOf(document.activeElement);
      if (!step || at < 0) return;
      const next = tabs[(at + step + tabs.length) % tabs.length];
      next.focus();
      choose(next);
      event.preventDefault();
      event.stopPropagation();
    });
    return (id) => choose(tabs.find((tab) => tab.getAttribute("aria-controls") === id) || tabs[0], false);
  };
})();
