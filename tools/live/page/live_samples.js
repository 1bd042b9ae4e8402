// The newest samples of a run under way, in a bounded number of rows.
import {Table} from "ballast/samples.js";

// At least `capacity` rows are kept, at most twice as many. Where a name is null, the column is not kept.
export class LiveSamples extends Table {
  constructor(names, capacity) {
    const kept = names.filter((name) => name !== null);
    super(new Map(kept.map((name) => [name, new Float32Array(2 * capacity)])), new Float64Array(2 * capacity), 0);
    this.names = names;
    this.capacity = capacity;
  }

  // Appends a row: numbers in the order of the names, null where there is none. A time that goes back begins anew.
  push(row, time) {
    if (this.rows > 0 && time <= this.end) {
      if (time === this.end) return;
      this.rows = 0;
    }
    if (this.rows === 2 * this.capacity) this.forgetOldest();
    this.time[this.rows] = time;
    this.names.forEach((name, k) => {
      if (name !== null) this.columns.get(name)[this.rows] = row[k] ?? NaN;
    });
    ++this.rows;
  }

  forgetOldest() {
    for (const column of [this.time, ...this.columns.values()]) column.copyWithin(0, this.capacity);
    this.rows = this.capacity;
  }

  clear() {
    this.rows = 0;
  }

  newest(name) {
    return this.rows ? this.columns.get(name)?.[this.rows - 1] : undefined;
  }

  // The rows from that time on, in columns of exactly their number.
  since(time) {
    let first = this.rows;
    while (first > 0 && this.time[first - 1] >= time) --first;
    const part = (column) => column.subarray(first, this.rows);
    const columns = new Map(Array.from(this.columns, ([name, column]) => [name, part(column)]));
    return new Table(columns, part(this.time), this.rows - first);
  }
}
