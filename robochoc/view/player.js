// The time of the playback. meshcat's animator shows this time; it does not run by itself, so that only the player
// controls speed, pauses and steps.
class Player {
  static SPEEDS = [0.25, 0.5, 1, 2, 4];
  static LEAD = 0.7; // seconds before the playback begins by itself
  static LONGEST = 0.5; // seconds from frame to frame: after more, the page was hidden

  constructor(duration) {
    this.duration = duration;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.last = null;
  }

  ontime = () => {};
  onstate = () => {};

  play(lead = 0) {
    if (this.ended) this.seek(0);
    this.wait = lead;
    this.last = null;
    this.playing = true;
    this.onstate();
  }

  pause() {
    this.playing = false;
    this.onstate();
  }

  get ended() { return this.time >= this.duration - 1e-6; }

  toggle() {
    if (this.playing) this.pause(); else this.play();
  }

  seek(time) {
    this.time = Math.min(Math.max(time, 0), this.duration);
    this.ontime(this.time);
    this.onstate();
  }

  // Once a frame; `now` in milliseconds.
  step(now) {
    if (!this.playing) return;
    const passed = this.last === null ? 0 : Math.min((now - this.last) / 1000, Player.LONGEST);
    this.last = now;
    this.wait -= passed;
    if (this.wait > 0) return;
    this.time = Math.min(this.time + this.speed * passed, this.duration);
    this.ontime(this.time);
    if (this.ended) this.pause();
  }
}
