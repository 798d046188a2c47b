"use strict";
/* The drones at the present moment of the page, in Meshcat's viewer: `Sniffer.scene(element, answer) -> {show(step)}`.

   `answer` is the `scene` of the server; null: there is nothing to show. During a run, more is requested by
   `scene?from=N`; N is `decisions` of the previous answer. The viewer is created when the element is first visible,
   since it needs its size. Without WebGL, a sentence is shown instead. */
(() => {
  const FLIGHT_MS = 260;
  const ASK_MS = 500; // the shortest time between two requests
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const SKIES = {
    light: [[0.8, 0.88, 0.95], [0.97, 0.97, 0.95]],
    dark: [[0.05, 0.07, 0.1], [0.12, 0.15, 0.2]],
  };

  /* The positions of a drone, each from a step on. */
  class Path {
    constructor(ground) {
      this.steps = [];
      this.places = [];
      this.ground = ground;
    }

    add(step, place) {
      const last = this.steps.length - 1;
      if (last >= 0 && this.steps[last] === step) this.places[last] = place;
      else {
        this.steps.push(step);
        this.places.push(place);
      }
    }

    at(step) {
      return this.places[Sniffer.lowerBound(this.steps, step + 1) - 1] || this.ground;
    }
  }

  class Scene {
    constructor(element, answer) {
      this.commands = answer.commands;
      this.drones = answer.drones;
      this.paths = this.drones.map((drone) => new Path(drone.ground));
      this.step = 0;
      this.flying = 0;
      this.said = "";
      this.stage = Sniffer.make("div", { class: "stage", role: "img" });
      this.stage.style.cssText = "position:relative;width:100%;height:100%;min-height:9rem;overflow:hidden;touch-action:none";
      this.inner = this.stage.appendChild(Sniffer.make("div"));
      this.inner.style.cssText = "position:absolute;inset:0";
      Sniffer.fill(element, this.stage);
      this.add(answer);
      new ResizeObserver(() => this.fit()).observe(this.stage);
      new MutationObserver(() => this.paintSky()).observe(document.documentElement, { attributeFilter: ["data-theme"] });
      Sniffer.palette.watch(() => this.paintSky());
    }

    add(answer) {
      this.decisions = answer.decisions;
      for (const [step, drone, ...place] of answer.moves) this.paths[drone].add(step, place);
      this.show(this.step);
    }

    /* Moves the drones to the decisions at the end of `step`. */
    show(step) {
      this.step = step;
      this.targets = this.paths.map((path) => path.at(step));
      const up = this.targets.reduce((count, place, drone) => count + (place[2] > this.paths[drone].ground[2]), 0);
      const said = `${Sniffer.many(this.drones.length, "drone")}, ${Sniffer.count(up)} in the air`;
      if (said !== this.said) this.stage.setAttribute("aria-label", (this.said = said));
      if (this.viewer) this.fly();
      this.ask();
    }

    /* Requests new decisions, if there is a server. */
    ask() {
      const { page } = Sniffer;
      if (this.asking || !page || Sniffer.Embedded.here() || page.model.decisionCount <= this.decisions) return;
      this.asking = true;
      setTimeout(async () => {
        try {
          const answer = await fetch(`./scene?from=${this.decisions}`, { cache: "no-store" });
          this.asking = false;
          if (answer.ok) this.add(await answer.json());
        } catch {
          this.asking = true; // the server has ended: there are no further decisions
        }
      }, ASK_MS);
    }

    fit() {
      if (!this.stage.offsetWidth || !this.stage.offsetHeight || this.failed) return;
      if (!this.viewer && !this.begin()) return;
      this.viewer.set_3d_pane_size();
      // In a narrow pane the scene must fit the width, not the height.
      this.viewer.camera.zoom = Math.min(1, this.stage.offsetWidth / this.stage.offsetHeight);
      this.viewer.camera.updateProjectionMatrix();
      this.viewer.set_dirty();
    }

    /* Whether the viewer exists. Its script is the last one of the page, and may not be loaded yet. */
    begin() {
      if (typeof MeshCat === "undefined") {
        if (document.readyState === "complete") this.fail("This page does not contain the 3D viewer.");
        else addEventListener("load", () => this.fit(), { once: true });
        return false;
      }
      try {
        this.viewer = new MeshCat.Viewer(this.inner);
        // By default the viewer has the height of the window, also after a change of its size.
        const resize = this.viewer.set_3d_pane_size.bind(this.viewer);
        this.viewer.set_3d_pane_size = () => resize(this.stage.offsetWidth, this.stage.offsetHeight);
        if (this.viewer.gui) this.viewer.gui.domElement.style.display = "none";
        for (const command of this.commands)
          this.viewer.handle_command_bytearray(Uint8Array.from(atob(command), (sign) => sign.charCodeAt(0)));
        this.objects = this.drones.map((drone) => this.viewer.scene_tree.find(["meshcat", ...drone.path.split("/")]).object);
      } catch (trouble) {
        this.fail("This browser cannot draw in 3D (WebGL), so the drones are not shown. Everything else on this page works.");
        return false;
      }
      this.commands = null;
      this.paintSky();
      this.label();
      this.objects.forEach((object, drone) => object.position.set(...this.targets[drone]));
      return true;
    }

    /* Labels that are readable, and do not overlap, from all directions. */
    label() {
      const object = (path) => this.viewer.scene_tree.find(["meshcat", ...path.split("/")]).object;
      const names = this.drones.map((drone) => object(`${drone.path}/name`));
      const labels = new Labels(this.viewer, names, object("axes"), () => [this.stage.offsetWidth, this.stage.offsetHeight]);
      setInterval(() => this.stage.offsetWidth && labels.choose(), Labels.EVERY);
    }

    fail(sentence) {
      this.failed = true;
      this.viewer = null;
      this.stage.removeAttribute("role");
      this.stage.removeAttribute("aria-label");
      Sniffer.fill(this.stage, Sniffer.make("p", { class: "hint" }, sentence));
    }

    fly() {
      const from = this.objects.map((object) => object.position.toArray());
      const until = this.targets;
      const began = performance.now();
      const flight = ++this.flying;
      const move = (now) => {
        if (flight !== this.flying) return;
        const part = still.matches ? 1 : Math.min(1, Math.max(0, now - began) / FLIGHT_MS);
        const eased = part * part * (3 - 2 * part);
        this.objects.forEach((object, drone) =>
          object.position.set(...from[drone].map((start, axis) => start + (until[drone][axis] - start) * eased)));
        this.viewer.set_dirty();
        if (part < 1) requestAnimationFrame(move);
      };
      if (still.matches) move(began);
      else requestAnimationFrame(move);
    }

    paintSky() {
      if (!this.viewer) return;
      const [top, bottom] = SKIES[Sniffer.palette.dark ? "dark" : "light"];
      this.viewer.set_property(["Background"], "top_color", top);
      this.viewer.set_property(["Background"], "bottom_color", bottom);
      this.viewer.set_dirty();
    }
  }

  /* No robot is known yet: the scene starts with the first decision. */
  class Waiting {
    constructor(element) {
      this.element = element;
      this.step = 0;
      Sniffer.fill(element, Sniffer.make("p", { class: "hint" }, "No robot has decided anything yet."));
    }

    show(step) {
      this.step = step;
      if (this.scene) return this.scene.show(step);
      if (this.asking || !Sniffer.page || !Sniffer.page.model.decisionCount) return undefined;
      this.asking = true;
      return this.begin();
    }

    async begin() {
      const answer = await Sniffer.page.source.scene().catch(() => null);
      this.asking = false;
      if (!answer || !answer.drones.length) return;
      this.scene = new Scene(this.element, answer);
      this.scene.show(this.step);
    }
  }

  Sniffer.scene = (element, answer) => {
    if (answer && answer.drones.length) return new Scene(element, answer);
    if (answer) return new Waiting(element);
    Sniffer.fill(element, Sniffer.make("p", { class: "hint" }, "There are no drones to show."));
    return { show() {} };
  };
})();
