// The time that replay, slider and plots share.

export class Clock {
  constructor(end) {
    this.end = end;
    this.time = 0;
    this.speed = 1;
    this.playing = false;
    this.listeners = [];
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  changed() {
    for (const listener of this.listeners) listener(this.time);
  }

  set(time) {
    const within = Math.min(Math.max(time, 0), this.end);
    if (within === this.time) return;
    this.time = within;
    this.changed();
  }

  // At the end, playing starts from the beginning.
  toggle() {
    this.playing = !this.playing;
    if (this.playing && this.time >= this.end) this.time = 0;
    this.changed();
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.changed();
  }

  // Called for every frame of the screen, with the time since the last one.
  advance(seconds) {
    if (!this.playing) return;
    this.set(this.time + this.speed * seconds);
    if (this.time >= this.end) this.pause();
  }
}
