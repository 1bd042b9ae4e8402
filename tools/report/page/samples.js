// The samples of a run: columns of float32. readSamples() has the encoding of assemble.py.

const BYTES = 4;

async function gunzip(text) {
  if (typeof DecompressionStream === "undefined")
    throw new Error(
        "This browser cannot unpack the samples (DecompressionStream is missing). Chrome and Edge from 80, " +
        "Firefox from 113 and Safari from 16.4 can.");
  const letters = atob(text), packed = new Uint8Array(letters.length);
  for (let i = 0; i < packed.length; ++i) packed[i] = letters.charCodeAt(i);
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
  return new Uint8Array(await new Response(stream).arrayBuffer());
}

export async function readSamples(text, described) {
  const bytes = await gunzip(text);
  const {rows, columns: names} = described;
  if (bytes.length !== BYTES * rows * names.length) throw new Error("The samples are incomplete.");
  const columns = new Map();
  names.forEach((name, number) => {
    const start = BYTES * rows * number;
    const [lowest, low, high, highest] = [0, 1, 2, 3].map((plane) => start + plane * rows);
    const bits = new Uint32Array(rows);
    let sum = 0;
    for (let row = 0; row < rows; ++row) {
      sum =
          (sum + (bytes[lowest + row] | bytes[low + row] << 8 | bytes[high + row] << 16 | bytes[highest + row] << 24)) |
          0;
      bits[row] = sum;
    }
    columns.set(name, new Float32Array(bits.buffer));
  });
  return new Samples(columns, rows);
}

// Columns of numbers over time. A column may be longer than the `rows` that count.
export class Table {
  constructor(columns, time, rows) {
    this.columns = columns;
    this.time = time;
    this.rows = rows;
  }

  // The time of the last row.
  get end() {
    return this.time[this.rows - 1];
  }

  has(name) {
    return this.columns.has(name);
  }

  get(name) {
    return this.columns.get(name);
  }

  // The last sample at or before that time.
  rowAt(time) {
    let low = 0, high = this.rows - 1;
    while (low < high) {
      const middle = (low + high + 1) >> 1;
      if (this.time[middle] <= time)
        low = middle;
      else
        high = middle - 1;
    }
    return low;
  }

  // The place between two samples: [row, next row, fraction of the interval].
  placeAt(time) {
    const row = this.rowAt(time), next = Math.min(row + 1, this.rows - 1);
    const span = this.time[next] - this.time[row];
    return [row, next, span > 0 ? Math.min(Math.max((time - this.time[row]) / span, 0), 1) : 0];
  }

  // The columns NAME_0, NAME_1, ... at a place, by linear interpolation.
  vectorAt(name, count, [row, next, part], out = []) {
    for (let j = 0; j < count; ++j) {
      const column = this.get(`${name}_${j}`);
      out[j] = column[row] + part * (column[next] - column[row]);
    }
    return out;
  }
}

class Samples extends Table {
  constructor(columns, rows) {
    const rest = columns.get("time_rest");
    super(columns, Float64Array.from(columns.get("time"), (time, row) => time + rest[row]), rows);
  }
}
