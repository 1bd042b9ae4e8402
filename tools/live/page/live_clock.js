// The time of the replay of a run under way: a little behind the newest frame, so that it goes on evenly between
// frames, which come in bursts.

const BEHIND_S = 0.1;        // of the wall clock
const WINDOW = 64;           // frames over which the run's speed is measured
const CATCH_UP_PER_S = 3;    // part of its error that the time makes up per second
const JUMP_S = 0.5;          // a greater error is made up at once
const STANDS_AFTER_S = 0.3;  // without a frame the run is taken to stand

export class LiveClock {
  constructor() {
    this.playing = true;  // for Plots
    this.listeners = [];
    this.reset();
  }

  reset() {
    this.time = 0;
    this.arrivals = [];
  }

  onChange(listener) {
    this.listeners.push(listener);
  }

  // The time of the newest frame.
  get end() {
    return this.arrivals.at(-1)?.time ?? 0;
  }

  // A frame of that time has arrived, at the wall clock's seconds.
  arrive(time, now) {
    if (time < this.end) this.reset();
    if (!this.arrivals.length) this.time = time;
    this.arrivals.push({time, now});
    if (this.arrivals.length > WINDOW) this.arrivals.shift();
  }

  // Simulated seconds per second of the wall clock.
  get speed() {
    const [first, last] = [this.arrivals[0], this.arrivals.at(-1)];
    return first && last.now > first.now ? (last.time - first.time) / (last.now - first.now) : 1;
  }

  // Called for every frame of the screen, with the wall clock's time and that since the last one.
  advance(now, seconds) {
    const last = this.arrivals.at(-1);
    if (!last) return;
    const {speed} = this, since = Math.min(now - last.now, STANDS_AFTER_S);
    const wanted = Math.min(last.time + speed * (since - BEHIND_S), last.time);
    const next = this.time + speed * seconds, error = wanted - next;
    const far = Math.abs(error) > JUMP_S * speed;
    const time = Math.min(far ? wanted : next + error * Math.min(CATCH_UP_PER_S * seconds, 1), last.time);
    if (time === this.time || (time < this.time && !far)) return;
    this.time = time;
    for (const listener of this.listeners) listener(time);
  }
}
