// The time line: the present time, the beginnings of epochs, and events.
class Timeline {
  static APART = 20; // pixels
  static BRIEF = 0.5; // seconds: a shorter epoch, without a flight, is shown together with the next

  constructor(playback, player) {
    this.playback = playback;
    this.player = player;
    this.slider = document.getElementById("time");
    this.hint = document.getElementById("hint");
    this.slider.max = playback.duration;
    this.slider.addEventListener("input", () => { player.pause(); player.seek(this.slider.valueAsNumber); });
    const dated = playback.chapters.length > 1 ? playback.chapters : [];
    this.buttons = dated.map((chapter, number) => this.add(
      chapter.at, String(number), `Epoch ${number}: ${chapter.opened}, ${chapter.says}`, ""));
    for (const mark of playback.marks)
      this.add(mark.at, "", `${playback.drones[mark.drone].name}: ${mark.says}`, "happened");
    this.chapter = -1;
    this.spread();
  }

  add(at, text, says, kind) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = kind;
    button.textContent = text;
    button.dataset.at = at;
    button.setAttribute("aria-label", `${says}; at ${at.toFixed(1)} s`);
    button.addEventListener("click", () => this.player.seek(at));
    for (const event of ["pointerenter", "focus"]) button.addEventListener(event, () => this.tell(button, says, at));
    for (const event of ["pointerleave", "blur"]) button.addEventListener(event, () => { this.hint.hidden = true; });
    document.getElementById("marks").append(button);
    return button;
  }

  // Every mark is below its time; marks that would cover each other are side by side, with a tick at their time.
  spread() {
    const room = this.slider.parentElement.clientWidth;
    const marks = [...document.querySelectorAll("#marks button")].sort((a, b) => a.dataset.at - b.dataset.at);
    const apart = Math.min(Timeline.APART, room / marks.length);
    const wanted = marks.map((mark) => room * mark.dataset.at / this.playback.duration);
    const spots = [];
    for (const spot of wanted) spots.push(Math.max(spot, (spots.at(-1) ?? -Infinity) + apart));
    for (let mark = marks.length - 1, most = room; mark >= 0; mark--, most -= apart) {
      most = Math.min(most, spots[mark]);
      marks[mark].style.left = `${most}px`;
      marks[mark].style.setProperty("--tick", `${wanted[mark] - most}px`);
    }
  }

  tell(button, says, at) {
    this.hint.textContent = `${says} (${at.toFixed(1)} s)`;
    this.hint.hidden = false;
    const room = this.slider.offsetWidth - this.hint.offsetWidth;
    this.hint.style.left = `${Math.max(Math.min(button.offsetLeft - this.hint.offsetWidth / 2, room), 0)}px`;
  }

  // The epoch at a time.
  at(time) {
    return this.playback.chapters.reduce((found, chapter, number) => (chapter.at <= time + 1e-6 ? number : found), 0);
  }

  // The beginning of the previous, or the next, epoch.
  beside(time, forth) {
    const begins = [...this.playback.chapters.map((chapter) => chapter.at), this.playback.duration];
    return forth ? begins.find((at) => at > time + 1e-3) ?? this.playback.duration
      : begins.reverse().find((at) => at < time - 0.2) ?? 0;
  }

  show(time) {
    const { duration, chapters } = this.playback;
    const chapter = this.at(time);
    this.slider.value = time;
    this.slider.style.setProperty("--done", `${100 * time / duration}%`);
    document.getElementById("clock").textContent = `${time.toFixed(1)} / ${duration.toFixed(1)} s`;
    const which = chapters.length > 1 ? `, epoch ${chapter} (0 to ${chapters.length - 1})` : "";
    this.slider.setAttribute("aria-valuetext", `${time.toFixed(1)} of ${duration.toFixed(1)} seconds${which}`);
    if (chapter === this.chapter || chapters.length < 2) return;
    this.chapter = chapter;
    const first = chapters.findIndex((one) => one.at >= chapters[chapter].at - Timeline.BRIEF);
    this.buttons.forEach((button, number) => button.setAttribute("aria-current", number >= first && number <= chapter));
    const line = document.getElementById("epoch");
    line.replaceChildren(...chapters.slice(first, chapter + 1).flatMap((one, number) => {
      const [count, opened] = [document.createElement("b"), document.createElement("span")];
      count.textContent = `Epoch ${first + number} (0 to ${chapters.length - 1})`;
      opened.className = "opened";
      opened.textContent = one.opened;
      return [count, " ", opened, `: ${one.says} `];
    }));
    line.hidden = false;
  }
}
