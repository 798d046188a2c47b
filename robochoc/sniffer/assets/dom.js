"use strict";
/* Small things the other files need: elements whose texts are text only, numbers as people read them, tabs. */
(() => {
  Sniffer.byId = (id) => document.getElementById(id);

  /* An element. Whatever is in `children` and is no element becomes text: data never becomes markup here. */
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

  /* Replaces the children only where something changed, so that live news do not close what a user has opened. */
  Sniffer.fill = (element, ...children) => {
    element.replaceChildren(...children.filter((child) => child !== null && child !== undefined));
    return element;
  };

  /* A sentence in which names stand between backticks, as what can be put into an element: these become code. */
  Sniffer.coded = (text) => String(text).split("`").map((part, at) => (at % 2 ? Sniffer.make("code", {}, part) : part));
  Sniffer.uncoded = (text) => String(text).replaceAll("`", "");

  const whole = new Intl.NumberFormat("en");
  Sniffer.count = (number) => whole.format(number);
  Sniffer.many = (number, one, several = one + "s") => `${whole.format(number)} ${number === 1 ? one : several}`;

  /* Seconds to a precision that tells neighbouring events apart; simulated steps are whole numbers. */
  Sniffer.moment = (t) => {
    if (!Number.isFinite(t)) return "";
    return Number.isInteger(t) ? whole.format(t) : t < 10 ? t.toFixed(4) : t < 1000 ? t.toFixed(3) : t.toFixed(1);
  };

  /* Said to screen readers, without moving anything. Repeating news are kept apart by time, not to talk all the while. */
  let spoken = 0;
  Sniffer.say = (text, seldom = false) => {
    const now = performance.now();
    if (seldom && now - spoken < 5000) return;
    spoken = now;
    Sniffer.byId("said").textContent = text;
  };

  /* Runs `action` at most every `ms`, with what was said last: all the while, and once more after the end. */
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

  /* A tablist as ARIA's authoring practices describe it: arrows move, the chosen tab alone is in the tab order. */
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
