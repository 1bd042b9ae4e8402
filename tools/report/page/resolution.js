// Chooses the resolution of the moving replay: as many pixels as can be drawn in time.
//
// Only the times between frames can be measured, and on a fast machine these are the screen's. So the resolution falls
// when frames come late. After a time without late frames a higher one is tried; each failure doubles that time. Where
// even the lowest resolution does not make frames come sooner, the highest is used: a browser that saves power shows 30
// frames a second whatever they cost.

export const FRAME_S = 1 / 60;
const LATE = 1.25;       // frames are late if their mean time exceeds this many FRAME_S
const SOON_LATE = 1.05;  // the same, where fewer pixels are known to help
const WINDOW = 8;        // the mean is taken over this many frames
const WINDOW_S = 0.4;    // or over this time, if that has fewer
const STEP = 0.8;
const LONGEST_STEP = 0.5;
const GAIN = 0.85;  // fewer pixels help if they reduce the time of a frame to at most this fraction
const FIRST_TRY_S = 1;
const LAST_TRY_S = 32;

export class Resolution {
  // Pixels of the drawing per pixel of the page, along a side: the greatest, first and least ratio. `pixelsMatter` is
  // true if fewer pixels are known to make frames come sooner, as where a processor draws, and null if that is unknown.
  constructor(most, first, least, pixelsMatter) {
    this.most = most;
    this.least = Math.min(least, most);
    this.ratio = Math.min(Math.max(first, this.least), most);
    this.tryAfter = FIRST_TRY_S;
    this.rose = false;
    this.meanBefore = null;  // mean time of a frame before the resolution fell
    this.meanAtLeast = null;
    this.pixelsMatter = pixelsMatter;
    this.late = pixelsMatter ? SOON_LATE : LATE;
    this.doubted = false;
    this.forget();
  }

  // Discards measurements, which are worthless after a pause.
  forget() {
    this.frames = this.seconds = this.inTime = 0;
  }

  // Called for every frame, with the time since the one before.
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
      // The cost grows with the square of the ratio.
      const step = Math.min(Math.max(Math.sqrt(FRAME_S / mean), LONGEST_STEP), STEP);
      this.ratio = Math.max(step * this.ratio, this.least);
    } else if (this.pixelsMatter === null) {
      this.meanAtLeast = mean;
      this.pixelsMatter = mean < GAIN * this.meanBefore;
      if (!this.pixelsMatter) this.ratio = this.most;
    }
  }

  // Called while all pixels are drawn because fewer seemed not to help. If frames now come later, fewer did help. If
  // they come sooner, the measurement was disturbed, as by a browser that was still compiling; it is repeated once.
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
