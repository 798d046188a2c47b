// The map of a team: cells, robots that can be dragged, and rules as links between them. North is up, and row 0 is the
// southernmost. The board only draws its props, and emits events for clicks, drags and keys. Names are text nodes, so
// they are never markup.
const MARGIN = 26;
const TALLEST = 660;
const AROUND = 300; // pixels of the window outside the map
const MENU = 230; // pixels of the menu of a robot
const DRAG = 4; // the minimum distance of a drag, in pixels
const ARROWS = { ArrowUp: [0, 1], ArrowDown: [0, -1], ArrowLeft: [-1, 0], ArrowRight: [1, 0] };
const clamp = (value, least, most) => Math.max(least, Math.min(most, value));

// The corners of the convex hull of points (Andrew's monotone chain).
function hull(points) {
  const sorted = [...points].sort((a, b) => a.x - b.x || a.y - b.y);
  const half = (list) => {
    const kept = [];
    for (const p of list) {
      while (kept.length > 1) {
        const [a, b] = kept.slice(-2);
        if ((b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) > 0) break;
        kept.pop();
      }
      kept.push(p);
    }
    return kept.slice(0, -1);
  };
  return sorted.length < 3 ? sorted : [...half(sorted), ...half(sorted.reverse())];
}

export default {
  template: `
    <div class="board" ref="box">
      <a class="skip" href="#" @click.prevent="past">{{ words.past }}</a>
      <svg :width="size.width" :height="size.height" role="group" :aria-label="words.map"
           :class="['tool-' + tool, { crowded: cell < 30 }]" @pointermove="dragged" @pointerup="dropped" @pointercancel="dropped">
        <rect class="ground" :x="m" :y="m" :width="columns * cell" :height="rows * cell" rx="6" />
        <path class="grid" :d="grid" />
        <path class="blocked" :d="holes" />
        <g class="axis" aria-hidden="true">
          <text v-for="tick in ticks.x" :x="m + (tick - 0.5) * cell" :y="m + rows * cell + 16">{{ tick }}</text>
          <text v-for="tick in ticks.y" :x="m - 12" :y="m + (rows - tick + 0.5) * cell + 4">{{ tick }}</text>
          <text class="north" :x="m + columns * cell / 2" y="16">▲ {{ words.north }}</text>
        </g>
        <rect v-if="target" class="target" :x="m + target.x * cell" :y="m + (rows - 1 - target.y) * cell" :width="cell" :height="cell" rx="4" />
        <rect ref="cells" class="cells" :x="m" :y="m" :width="columns * cell" :height="rows * cell" tabindex="0" role="button"
              :aria-label="cellWords" @pointermove="hoverCell" @pointerleave="over = null" @click="clickCell"
              @keydown="typedAtCell" @focus="cursor = cursor || { x: 0, y: rows - 1 }" @blur="cursor = null" />
        <g v-for="link in drawn" :key="link.rule" :class="['link', link.shape, { dense: link.of.length > 400, soft: link.soft, lit: link.rule === shownRule, dim: shownRule && link.rule !== shownRule }]"
           :style="{ '--line': 'var(--rule-' + link.color + ')' }">
          <path class="seen" :d="link.d" :style="link.wide" />
          <path v-if="link.tips" class="tips" :d="link.tips" />
          <path class="hit" :style="link.wide" :d="drag && drag.moved ? '' : link.d" tabindex="0" role="button" :aria-label="link.sentence" @pointerenter="enter(link, $event)" @pointerleave="hovered = null"
                @focus="hovered = link.rule; spot = link.middle" @blur="hovered = null" @click="$emit('rule', link.rule)"
                @keydown.enter.prevent="$emit('rule', link.rule)" @keydown.space.prevent="$emit('rule', link.rule)" />
        </g>
        <g v-for="(robot, index) in placed" :key="robot.name" class="robot" tabindex="0" role="button" :data-robot="robot.name"
           :class="{ chosen: chosen.has(robot.name), bad: robot.trouble, held: drag && drag.name === robot.name, gone: robot.gone }"
           :aria-label="robot.says" :aria-pressed="chosen.has(robot.name)" :transform="'translate(' + robot.px + ' ' + robot.py + ')'"
           @pointerdown="pressed(robot, $event)" @keydown="typedAt(robot, index, $event)">
          <title>{{ robot.says }}</title>
          <circle class="halo" :r="radius + 4" />
          <circle class="body" :r="radius" />
          <path class="rotors" :d="rotors" />
          <text v-if="robot.mark" class="mark" :x="radius + 1" :y="-radius + 2">{{ robot.mark }}</text>
          <g v-if="robot.trouble" class="alarm" :transform="'translate(' + (-radius * 0.8) + ' ' + (-radius * 0.8) + ')'">
            <circle r="7" /><text y="4">!</text>
          </g>
          <text class="name" :y="radius + 13">{{ robot.label }}</text>
          <text v-if="robot.note" class="note" :y="radius + 25">{{ robot.note }}</text>
        </g>
        <g v-if="!robots.length && words.begin" class="begin" :transform="'translate(' + size.width / 2 + ' ' + (size.height / 2 - 12) + ')'" aria-hidden="true">
          <circle r="24" cy="-30" /><path d="M-9 -30h18M0 -39v18" /><text y="18">{{ words.begin }}</text>
        </g>
        <g v-if="label" class="words" :transform="'translate(' + label.x + ' ' + label.y + ')'" aria-hidden="true">
          <rect :x="-label.width / 2" y="-13" :width="label.width" height="24" rx="12" /><text y="4">{{ label.text }}</text>
        </g>
      </svg>
      <div v-if="menu" ref="menu" class="acts-menu" role="menu" :aria-label="menu.says" :style="{ left: menu.left + 'px', top: menu.top + 'px' }"
           @keydown="typedInMenu" @focusout="leftMenu">
        <p class="soft small" aria-hidden="true">{{ menu.says }}</p>
        <button v-for="[act, says] in menu.acts" type="button" role="menuitem" tabindex="-1" @click="happens(act)">{{ says }}</button>
      </div>
    </div>`,
  props: {
    columns: Number, rows: Number, blocked: Array, robots: Array, links: Array, selected: Array,
    lit: String, tool: String, words: Object, movable: Boolean, heard: Number, acts: Object,
  },
  emits: ["act", "robot", "cell", "moved", "removed", "rule", "cleared"],
  data: () => ({ width: 640, tall: TALLEST, local: {}, sent: 0, over: null, cursor: null, drag: null, hovered: null, spot: null, next: null, menu: null }),
  mounted() {
    this.watcher = new ResizeObserver(([box]) => {
      this.width = Math.floor(box.contentRect.width);
      this.tall = clamp(window.innerHeight - AROUND, 300, TALLEST);
    });
    this.watcher.observe(this.$refs.box);
  },
  unmounted() {
    this.watcher.disconnect();
  },
  watch: {
    robots() {
      // The props may be older than the last moves: moves that the page has not confirmed yet are retained.
      this.local = Object.fromEntries(Object.entries(this.local).filter(([, cell]) => cell.sent > this.heard));
      if (this.next !== null) this.$nextTick(this.focusNext);
    },
  },
  computed: {
    m: () => MARGIN,
    cell() {
      return Math.floor(clamp(Math.min((this.width - 2 * MARGIN) / this.columns, this.tall / this.rows), 11, 92));
    },
    size() {
      return { width: this.columns * this.cell + 2 * MARGIN, height: this.rows * this.cell + 2 * MARGIN };
    },
    radius() {
      return clamp(this.cell * 0.26, 6, 20);
    },
    rotors() {
      const r = this.radius, at = r * 0.42, s = r * 0.26;
      const ring = (x, y) => `M${x - s} ${y}a${s} ${s} 0 1 0 ${2 * s} 0a${s} ${s} 0 1 0 ${-2 * s} 0`;
      return `M${-at} ${-at}L${at} ${at}M${-at} ${at}L${at} ${-at}` + ring(-at, -at) + ring(at, -at) + ring(-at, at) + ring(at, at);
    },
    grid() {
      const m = MARGIN, c = this.cell, w = this.columns * c, h = this.rows * c;
      let d = "";
      for (let x = 1; x < this.columns; x++) d += `M${m + x * c} ${m}v${h}`;
      for (let y = 1; y < this.rows; y++) d += `M${m} ${m + y * c}h${w}`;
      return d;
    },
    holes() {
      const c = this.cell;
      return this.blocked.map(([x, y]) => `M${MARGIN + x * c + 1} ${MARGIN + (this.rows - 1 - y) * c + 1}h${c - 2}v${c - 2}h${2 - c}z`).join("");
    },
    ticks() {
      const step = this.cell >= 22 ? 1 : 5;
      const of = (count) => [...Array(count).keys()].map((i) => i + 1).filter((i) => i === 1 || i % step === 0);
      return { x: of(this.columns), y: of(this.rows) };
    },
    target() {
      return this.drag?.cell || this.cursor || (this.tool === "select" ? null : this.over);
    },
    cellWords() {
      const at = this.cursor || { x: 0, y: this.rows - 1 };
      const who = this.robots.filter((robot) => robot.x === at.x && robot.y === at.y).map((robot) => robot.name);
      const hole = this.blocked.some(([x, y]) => x === at.x && y === at.y) ? [this.words.hole] : [];
      const cell = this.words.cell.replace("{column}", at.x + 1).replace("{row}", at.y + 1);
      return [cell, ...hole, ...who].join(", ");
    },
    chosen() {
      return new Set(this.selected);
    },
    // Robots in one cell are drawn around its centre.
    placed() {
      const there = new Map();
      const at = this.robots.map((robot) => {
        const cell = this.local[robot.name] || robot, key = cell.x * 1000 + cell.y;
        there.set(key, [...(there.get(key) || []), robot.name]);
        return { cell, key };
      });
      const most = this.cell < 30 ? 40 : Math.floor((this.cell * 1.5) / 6.5); // of crowded robots, only one name is shown at a time
      return this.robots.map((robot, index) => {
        const { cell, key } = at[index], mates = there.get(key);
        let { px, py } = this.middle(cell);
        if (this.drag?.moved && this.drag.name === robot.name) ({ px, py } = this.drag);
        else if (mates.length > 1) {
          const turn = (2 * Math.PI * mates.indexOf(robot.name)) / mates.length;
          px += Math.cos(turn) * this.cell * 0.24;
          py += Math.sin(turn) * this.cell * 0.24;
        }
        const label = robot.name.length > most ? robot.name.slice(0, most - 1) + "…" : robot.name;
        return { ...robot, x: cell.x, y: cell.y, px, py, label };
      });
    },
    drawn() {
      const between = new Map(), beside = new Map(), n = this.placed.length;
      // Hulls are behind lines; of several hulls around the same robots, each is larger than the one before, so that each can
      // be clicked.
      const links = this.links.filter((link) => link.of.every((i) => i < n));
      const hulls = links.filter((link) => link.shape === "hull"), rest = links.filter((link) => link.shape !== "hull");
      return [...hulls, ...rest].map((link, nth) => {
        const points = link.of.map((index) => ({ x: this.placed[index].px, y: this.placed[index].py, index }));
        const wide = link.shape === "hull" ? { strokeWidth: this.cell * 0.8 + 12 * Math.min(hulls.length - 1 - nth, 4) + "px", "--fade": 0.03 + 0.1 / hulls.length } : {};
        return { ...link, wide, ...this[link.shape](points, between, beside, n) };
      });
    },
    shownRule() {
      return this.hovered || this.lit || null;
    },
    label() {
      const link = this.drawn.find((one) => one.rule === this.shownRule);
      const at = this.hovered ? this.spot : link?.middle;
      if (!link || !at) return null;
      const width = Math.min(link.words.length * 7 + 26, this.size.width);
      const text = link.words.length > 60 ? link.words.slice(0, 59) + "…" : link.words;
      return { text, width, x: clamp(at.x, width / 2, this.size.width - width / 2), y: clamp(at.y - 16, 16, this.size.height - 14) };
    },
  },
  methods: {
    middle({ x, y }) {
      return { px: MARGIN + (x + 0.5) * this.cell, py: MARGIN + (this.rows - 0.5 - y) * this.cell };
    },
    // The shapes of links. Several lines between the same two robots are bent.
    line(points, between, _beside, n) {
      let d = "", tips = "", middle = null;
      const add = (one, other, directed) => {
        const key = Math.min(one.index, other.index) * n + Math.max(one.index, other.index);
        const nth = between.get(key) || 0;
        between.set(key, nth + 1);
        const turned = one.index < other.index ? 1 : -1;
        const bend = Math.ceil(nth / 2) * (nth % 2 ? 1 : -1) * 16 * turned;
        const dx = other.x - one.x, dy = other.y - one.y, length = Math.hypot(dx, dy) || 1;
        const mx = (one.x + other.x) / 2 - (dy / length) * bend, my = (one.y + other.y) / 2 + (dx / length) * bend;
        const x = (mx + (one.x + other.x) / 2) / 2, y = (my + (one.y + other.y) / 2) / 2;
        d += bend ? `M${one.x} ${one.y}Q${mx} ${my} ${other.x} ${other.y}` : `M${one.x} ${one.y}L${other.x} ${other.y}`;
        middle = middle || { x, y };
        const ux = dx / length, uy = dy / length;
        if (directed) tips += `M${x + ux * 7} ${y + uy * 7}L${x - ux * 5 - uy * 5} ${y - uy * 5 + ux * 5}L${x - ux * 5 + uy * 5} ${y - uy * 5 - ux * 5}z`;
      };
      return (directed) => {
        for (let i = 0; i + 1 < points.length; i += 2) add(points[i], points[i + 1], directed);
        return { d, tips, middle };
      };
    },
    lines(points, between, beside, n) {
      return this.line(points, between, beside, n)(false);
    },
    arrows(points, between, beside, n) {
      return this.line(points, between, beside, n)(true);
    },
    dots(points, _between, beside) {
      const at = points.map(({ x, y, index }) => {
        const nth = beside.get(index) || 0, turn = -Math.PI / 2 + nth * 0.55, far = this.radius + 5;
        beside.set(index, nth + 1);
        return { x: x + Math.cos(turn) * far, y: y + Math.sin(turn) * far };
      });
      const d = at.map(({ x, y }) => `M${x - 4} ${y}a4 4 0 1 0 8 0a4 4 0 1 0 -8 0z`).join("");
      return { d, middle: at[0] || null };
    },
    hull(points) {
      const corners = hull(points);
      if (!corners.length) return { d: "", middle: null };
      const x = corners.reduce((sum, p) => sum + p.x, 0) / corners.length, y = corners.reduce((sum, p) => sum + p.y, 0) / corners.length;
      return { d: `M${corners.map((p) => `${p.x} ${p.y}`).join("L")}z`, middle: { x, y } };
    },
    at(event) {
      const box = this.$refs.cells.getBoundingClientRect();
      return { px: event.clientX - box.left + MARGIN, py: event.clientY - box.top + MARGIN };
    },
    cellAt({ px, py }) {
      const x = Math.floor((px - MARGIN) / this.cell), y = this.rows - 1 - Math.floor((py - MARGIN) / this.cell);
      return { x: clamp(x, 0, this.columns - 1), y: clamp(y, 0, this.rows - 1) };
    },
    hoverCell(event) {
      if (event.pointerType === "mouse") this.over = this.cellAt(this.at(event));
    },
    enter(link, event) {
      const { px, py } = this.at(event);
      this.hovered = link.rule;
      this.spot = { x: px, y: py };
    },
    clickCell(event) {
      const here = this.at(event), cell = this.cellAt(here);
      this.$emit("cell", cell);
      this.offer("cell", cell, this.words.cell.replace("{column}", cell.x + 1).replace("{row}", cell.y + 1), here, event.currentTarget);
    },
    // Opens the menu of a robot or a cell at its position.
    offer(kind, target, says, { px, py }, back) {
      const acts = this.acts?.[kind];
      if (!acts?.length) return;
      const svg = back.ownerSVGElement.getBoundingClientRect(), box = this.$refs.box.getBoundingClientRect();
      const left = clamp(px + svg.left - box.left + 12, 0, Math.max(0, box.width - MENU)), top = py + svg.top - box.top + 12;
      this.menu = { target, says, acts, back, left, top: Math.max(0, Math.min(top, box.height - 36 * (acts.length + 1))) };
      this.$nextTick(() => this.$refs.menu?.querySelector("button")?.focus());
    },
    happens(act) {
      const { target } = this.menu;
      this.closeMenu();
      this.$emit("act", { act, ...target });
    },
    closeMenu() {
      const { back } = this.menu || {};
      this.menu = null;
      if (back?.isConnected) back.focus({ preventScroll: true });
    },
    leftMenu(event) {
      if (!event.relatedTarget || !this.$refs.menu?.contains(event.relatedTarget)) this.menu = null;
    },
    typedInMenu(event) {
      const items = [...this.$refs.menu.querySelectorAll("button")], at = items.indexOf(document.activeElement);
      const to = { ArrowDown: (at + 1) % items.length, ArrowUp: (at + items.length - 1) % items.length, Home: 0, End: items.length - 1 }[event.key];
      if (to !== undefined) items[to].focus();
      else if (event.key === "Escape") this.closeMenu();
      else return;
      event.preventDefault();
      event.stopPropagation();
    },
    pressed(robot, event) {
      if (event.button) return;
      event.currentTarget.setPointerCapture(event.pointerId);
      this.drag = { name: robot.name, from: this.at(event), px: robot.px, py: robot.py, moved: false, cell: null };
    },
    dragged(event) {
      if (!this.drag || !this.movable) return;
      const here = this.at(event), { from } = this.drag;
      if (!this.drag.moved && Math.hypot(here.px - from.px, here.py - from.py) < DRAG) return;
      this.drag = { ...this.drag, ...here, moved: true, cell: this.cellAt(here) };
    },
    dropped(event) {
      const drag = this.drag;
      this.drag = null;
      if (!drag || event.type === "pointercancel") return;
      if (drag.moved) this.move(drag.name, drag.cell);
      else this.clickRobot(drag.name, event);
    },
    clickRobot(name, event) {
      this.$emit("robot", { name, more: event.shiftKey || event.ctrlKey || event.metaKey });
      const robot = this.placed.find((one) => one.name === name);
      const back = [...this.$refs.box.querySelectorAll(".robot")].find((one) => one.dataset.robot === name);
      if (robot && back) this.offer("robot", { name }, name, robot, back);
    },
    move(name, cell) {
      const robot = this.placed.find((one) => one.name === name);
      if (robot && (robot.x !== cell.x || robot.y !== cell.y)) {
        const sent = ++this.sent;
        this.local = { ...this.local, [name]: { ...cell, sent } };
        this.$emit("moved", { name, ...cell, sent });
      }
    },
    step(cell, [dx, dy]) {
      return { x: clamp(cell.x + dx, 0, this.columns - 1), y: clamp(cell.y + dy, 0, this.rows - 1) };
    },
    typedAtCell(event) {
      if (ARROWS[event.key]) this.cursor = this.step(this.cursor, ARROWS[event.key]);
      else if (event.key === "Enter" || event.key === " ") {
        this.$emit("cell", this.cursor);
        this.offer("cell", { ...this.cursor }, this.cellWords, this.middle(this.cursor), event.currentTarget);
      }
      else if (event.key === "Escape") this.$emit("cleared");
      else return;
      event.preventDefault();
    },
    typedAt(robot, index, event) {
      if (ARROWS[event.key] && this.movable) this.move(robot.name, this.step(robot, ARROWS[event.key]));
      else if (event.key === "Enter" || event.key === " ") this.clickRobot(robot.name, event);
      else if (event.key === "Delete" || event.key === "Backspace") {
        this.next = index;
        this.$emit("removed", robot.name);
      } else if (event.key === "Escape") this.$emit("cleared");
      else return;
      event.preventDefault();
    },
    focusNext() {
      const there = this.$refs.box.querySelectorAll(".robot");
      const next = there[Math.min(this.next, there.length - 1)] || this.$refs.cells;
      this.next = null;
      if (document.activeElement === document.body) next.focus();
    },
    past() {
      const after = [...document.querySelectorAll("button, input, [tabindex='0']")].find(
        (one) => this.$refs.box.compareDocumentPosition(one) & Node.DOCUMENT_POSITION_FOLLOWING && !this.$refs.box.contains(one));
      after?.focus();
    },
  },
};
