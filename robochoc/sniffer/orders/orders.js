"use strict";
/* Steps through the state graph. `trail` are the chosen steps, as places among the steps of each state; `at` is the number
   of those that are done. The steps after `at` stay until another message is chosen. */
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const byId = (id) => document.getElementById(id);
  const MOST_ENDS = 12;
  const LEFT_OUT = -1;

  /* Creates an element. Items of `children` that are not elements become text, so data never becomes markup. */
  const make = (name, properties = {}, ...children) => {
    const element = document.createElement(name);
    for (const [key, value] of Object.entries(properties)) {
      if (value === undefined || value === null || value === false) continue;
      if (key === "onclick") element.addEventListener("click", value);
      else element.setAttribute(key, value);
    }
    element.append(...children.filter((child) => child !== null));
    return element;
  };

  let trail = [...data.path];
  let at = 0;

  /* The numbers of the states on the trail, from the start on. */
  const statesOn = () => {
    const states = [0];
    for (const step of trail) states.push(data.states[states[states.length - 1]].steps[step].after);
    return states;
  };

  // Changes

  const show = (place, focus) => {
    at = Math.min(Math.max(place, 0), trail.length);
    paint();
    if (focus) focus();
  };

  const choose = (step) => {
    const number = statesOn()[at];
    if (data.states[number].steps[step].after === LEFT_OUT) return;
    trail = [...trail.slice(0, at), step];
    show(at + 1, () => (document.querySelector("#choices button:not(:disabled)") || byId("choices-title")).focus({ preventScroll: true }));
    byId("said").textContent = `Step ${at}: ${data.states[number].steps[step].text}. ${byId("end").textContent}`;
  };

  /* Breadth first from a state: for each end, the steps of a shortest way; and whether states are missing on the page. */
  const ahead = (from) => {
    const before = new Map([[from, null]]);
    const found = new Map();
    let missing = false;
    const waiting = [from];
    for (let next = 0; next < waiting.length; next++) {
      const state = data.states[waiting[next]];
      const end = state.fault || state.answer;
      if (end && !found.has(end)) found.set(end, waiting[next]);
      state.steps.forEach(({ after }, place) => {
        if (after === LEFT_OUT) missing = true;
        else if (!before.has(after)) {
          before.set(after, [waiting[next], place]);
          waiting.push(after);
        }
      });
    }
    const way = (state) => {
      const steps = [];
      for (let one = before.get(state); one; one = before.get(one[0])) steps.unshift(one[1]);
      return steps;
    };
    const ends = [...found].map(([text, state]) => ({ text, fault: Boolean(data.states[state].fault), way: way(state) }));
    return { ends, missing, count: waiting.length };
  };

  // What is shown

  const list = (title, items) => (items.length ? [make("h4", {}, title), make("ul", {}, ...items)] : []);

  const robot = (known, old, acted) => {
    const change = old && old.value !== known.value ? `was ${old.value}` : "";
    const more = Object.entries(known.more);
    return make("article", { class: acted ? "robot acted" : "robot", "aria-label": known.name },
      make("h3", {}, known.name, change ? make("small", {}, change) : null),
      make("p", { class: "value" }, known.value),
      ...list("It knows", known.view.map(([name, text]) => make("li", {}, text.includes(" = ") || !name ? text : `${name}: ${text}`))),
      ...list("Its values", known.domain.map(([value, reason]) => make("li", reason === null ? {} : { class: "out" },
        reason === null ? value : `${value}: ruled out by ${reason}`))),
      ...list("Nogoods", known.nogoods.map((text) => make("li", {}, text))),
      more.length ? make("h4", {}, "Also") : null,
      more.length ? make("dl", {}, ...more.flatMap(([name, text]) => [make("dt", {}, name), make("dd", {}, text)])) : null);
  };

  const choices = (state) => {
    let number = 0;
    const button = (place, text) => {
      number += 1;
      const leftOut = state.steps[place].after === LEFT_OUT;
      return make("button", { type: "button", class: "choice", disabled: leftOut, "data-place": place, onclick: () => choose(place) },
        number < 10 ? make("kbd", { "aria-hidden": "true" }, number) : null, leftOut ? `${text} (not on this page)` : text);
    };
    const used = new Set();
    const channels = state.queues.map(({ to, from, messages }) => {
      const places = [false, true].map((lost) => state.steps.findIndex((step) => step.to === to && step.from === from && step.lost === lost));
      places.forEach((place) => used.add(place));
      const [first, ...later] = messages.filter((one) => one >= 0).map((one) => data.messages[one]);
      const rest = places[0] >= 0 ? later : [first, ...later].filter((one) => one !== undefined);
      const lost = messages.filter((one) => one < 0).length;
      return make("div", { class: "channel" },
        make("h3", {}, `${from} to ${to}`),
        places[0] >= 0 ? button(places[0], first) : null,
        places[1] >= 0 ? button(places[1], "it is lost") : null,
        lost ? make("p", {}, lost === 1 ? "1 message was lost" : `${lost} messages were lost`) : null,
        ...rest.map((text) => make("p", {}, `${places[0] >= 0 ? "then: " : ""}${text}`)));
    });
    const others = state.steps.map((step, place) => [step, place]).filter(([, place]) => !used.has(place));
    return [...channels, ...(others.length ? [make("div", { class: "channel" }, make("h3", {}, "Other steps"),
      ...others.map(([step, place]) => button(place, step.text)))] : [])];
  };

  const paintSteps = (states) => {
    const items = ["Start", ...trail.map((step, place) => data.states[states[place]].steps[step].text)];
    byId("steps").replaceChildren(...items.map((text, place) => make("li", {},
      make("button", { type: "button", class: place > at ? "later" : null, "aria-current": place === at ? "step" : null,
        onclick: () => show(place, () => byId("steps").querySelector("[aria-current]").focus()) }, make("span", {}, text)))));
    const current = byId("steps").querySelector("[aria-current]");
    if (current) byId("steps").scrollTop = current.offsetTop - byId("steps").offsetTop - byId("steps").clientHeight / 2;
    byId("back").disabled = byId("first").disabled = at === 0;
    byId("on").disabled = byId("last").disabled = at === trail.length;
  };

  const paintAhead = (number) => {
    const { ends, missing, count } = ahead(number);
    const mark = (end) => (end.fault ? "✗ " : "✓ ");
    const faults = ends.filter((end) => end.fault);
    const others = ends.filter((end) => !end.fault);
    byId("ends").replaceChildren(...[...faults, ...others].slice(0, MOST_ENDS).map((end) => make("li", {}, end.way.length
      ? make("button", { type: "button", class: end.fault ? "bad" : null, title: "Go there by a shortest way", onclick: () => {
        trail = [...trail.slice(0, at), ...end.way];
        show(trail.length, () => byId("now-title").scrollIntoView({ block: "nearest" }));
      } }, `${mark(end)}${end.text} (${end.way.length === 1 ? "1 step" : `${end.way.length} steps`})`)
      : `${mark(end)}${end.text} (now)`)));
    const more = ends.length - MOST_ENDS;
    const rest = [more > 0 ? `And ${more} other ends.` : "", ends.length || missing ? "" : "No end: the robots continue forever.",
      `${count === 1 ? "1 state" : `${count} states`} from here${missing ? ", and others that are not on this page" : ""}.`];
    byId("rest").textContent = rest.filter(Boolean).join(" ");
    byId("rest").hidden = false;
  };

  const paint = () => {
    const states = statesOn();
    const state = data.states[states[at]];
    paintSteps(states);
    const end = byId("end");
    end.hidden = !state.fault && !state.answer;
    end.className = state.fault ? "end bad" : "end";
    end.textContent = state.fault ? `✗ ${state.fault}` : state.answer ? `✓ The search is over: ${state.answer}` : "";
    byId("right").textContent = state.right;
    const earlier = states.slice(0, at).indexOf(states[at]);
    byId("again").hidden = earlier < 0;
    byId("again").textContent = earlier < 0 ? "" : `The same state as ${earlier ? `after step ${earlier}` : "at the start"}.`;
    const last = at > 0 ? data.states[states[at - 1]] : null;
    const acted = last ? last.steps[trail[at - 1]].to : "";
    const before = new Map((last ? last.robots : []).map((one) => [data.robots[one].name, data.robots[one]]));
    byId("robots").replaceChildren(...state.robots.map((one) => data.robots[one]).map((one) => robot(one, before.get(one.name), one.name === acted)));
    byId("choices").replaceChildren(...choices(state));
    byId("choices-title").textContent = state.steps.length ? "Which message arrives next?" : state.queues.length ? "Messages in transit" : "No message is in transit";
    paintAhead(states[at]);
  };

  // Start

  const outside = matchMedia("(prefers-color-scheme: dark)");
  let theme = "";
  const paintTheme = () => {
    document.documentElement.dataset.theme = theme || (outside.matches ? "dark" : "light");
  };
  outside.addEventListener("change", paintTheme);
  byId("theme").addEventListener("click", () => {
    theme = document.documentElement.dataset.theme === "dark" ? "light" : "dark";
    paintTheme();
  });
  paintTheme();

  byId("title").textContent = data.title;
  byId("facts").textContent = data.facts;
  if (data.fault) {
    byId("fault").hidden = false;
    byId("fault").querySelector("p").textContent = data.fault;
  }
  if (!data.states.length) {
    for (const id of ["path", "now", "ahead"]) byId(id).hidden = true;
    return;
  }
  byId("first").addEventListener("click", () => show(0));
  byId("back").addEventListener("click", () => show(at - 1));
  byId("on").addEventListener("click", () => show(at + 1));
  byId("last").addEventListener("click", () => show(trail.length));
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const places = { ArrowLeft: at - 1, ArrowRight: at + 1, Home: 0, End: trail.length };
    if (event.key in places) show(places[event.key]);
    else if (/^[1-9]$/.test(event.key)) {
      const button = byId("choices").querySelectorAll("button")[Number(event.key) - 1];
      if (!button || button.disabled) return;
      choose(Number(button.dataset.place));
    } else return;
    event.preventDefault();
  });
  show(0);
})();
