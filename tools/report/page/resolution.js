// How many pixels the replay is drawn with while it moves: as many as come in time.
//
// Only the times between frames are known here, and they say nothing of what a frame could have cost: on a fast machine
// they are the screen's. So the number falls where frames come late; after frames that came in time more are tried,
// each time that fails twice as long after; and where the fewest pixels do not make frames come sooner, all are drawn:
// a browser that saves power shows 30 frames a second whatever they cost.

export const FRAME_S = 1 / 60;
const LATE = 1.25;       // of that: a mean beyond it is late;
const SOON_LATE = 1.05;  // likewise, where fewer pixels are known to help
const WINDOW = 8;        // frames whose mean is judged,
const WINDOW_S = 0.4;    // or those of that time, if they are fewer
const STEP = 0.8;
const LONGEST_STEP = 0.5;
const GAIN = 0.85;  // fewer pixels help where a frame takes at most that part of what it did
const FIRST_TRY_S = 1;
const LAST_TRY_S = 32;

export class Resolution {
  // Pixels of the drawing per pixel of the page (along a side): at most, to begin with, at least. Whether it is known
  // that frames with fewer come sooner (true), as where a processor draws; null: it is to be found out.
  constructor(most, first, least, pixelsMatter) {
    this.most = most;
    this.least = Math.min(least, most);
    this.ratio = Math.min(Math.max(first, this.least), most);
    this.tryAfter = FIRST_TRY_S;
    this.rose = false;
    this.meanBefore = null;  // of a frame, before the number fell
    this.meanAtLeast = null;
    this.pixelsMatter = pixelsMatter;
    this.late = pixelsMatter ? SOON_LATE : LATE;
    this.doubted = false;
    this.forget();
  }

  // What was, says nothing of what comes: after a pause.
  forget() {
    this.frames = this.seconds = this.inTime = 0;
  }

  // A frame came so long after the one before.
  frame(seconds) {
    ++this.frames;
    this.seconds += seconds;
    if (this.frames < WINDOW && this.seconds < WINDOW_S) return;
    const mean = this.seconds / this.frames, late = mean > this.late * FRAME_S;
    this.inTime = late ? 0 : this.inTime + this.seconds;
    this.frames = this.seconds = 0;
    if (this.pixelsMatter === false) this.doubt(mean);
    if (this.pixelsMatter === false) return;
    if (late)
      this.fall(mean);
    else if (this.ratio < this.most && this.inTime >= this.tryAfter)
      this.rise();
  }

  fall(mean) {
    if (this.rose) this.tryAfter = Math.min(2 * this.tryAfter, LAST_TRY_S);
    this.rose = false;
    this.meanBefore ??= mean;
    if (this.ratio > this.least) {
      // The cost of pixels goes with the square.
      const step = Math.min(Math.max(Math.sqrt(FRAME_S / mean), LONGEST_STEP), STEP);
      this.ratio = Math.max(step * this.ratio, this.least);
    } else if (this.pixelsMatter === null) {
      this.meanAtLeast = mean;
      this.pixelsMatter = mean < GAIN * this.meanBefore;
      if (!this.pixelsMatter) this.ratio = this.most;
    }
  }

  // All are drawn because fewer did not help. If frames come later now, fewer did; if sooner, what was seen of fewer
  // was something else, as a browser that was still compiling: it is tried again, once.
  doubt(mean) {
    if (mean > this.meanAtLeast / GAIN) this.pixelsMatter = true;
    if (mean < this.meanAtLeast * GAIN && !this.doubted) {
      this.pixelsMatter = this.meanBefore = null;
      this.doubted = true;
    }
  }

  rise() {
    this.ratio = Math.min(this.ratio / STEP, this.most);
    this.inTime = 0;
    this.rose = true;
  }
}
