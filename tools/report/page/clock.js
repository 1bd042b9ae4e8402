// The one time that replay, slider and plots share.

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

  // From the start again, once the end is reached.
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

  // One frame of the screen later.
  advance(seconds) {
    if (!this.playing) return;
    this.set(this.time + this.speed * seconds);
    if (this.time >= this.end) this.pause();
  }
}
