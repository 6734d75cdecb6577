// What the plots remember: the last minute, on the robot's own clock.

const CAPACITY = 2400;
const KEPT_S = 62;
const GAP_S = 0.5;

export class History {
  /** `keys`: names of the values kept beside the time. */
  constructor(keys) {
    this.keys = keys;
    this.clear();
  }

  clear() {
    this.time = new Float64Array(CAPACITY);
    this.columns = Object.fromEntries(this.keys.map((key) => [key, new Float64Array(CAPACITY)]));
    this.start = 0;
    this.end = 0;
  }

  get newest() {
    return this.end > this.start ? this.time[this.end - 1] : 0;
  }

  /** Append a sample; a clock that ran back starts anew, a gap breaks the line. */
  push(time_s, values) {
    if (this.end > this.start) {
      if (time_s < this.newest) this.clear();
      else if (time_s === this.newest) return;
      else if (time_s - this.newest > GAP_S) this.#append(this.newest + 1e-6, {});
    }
    this.#append(time_s, values);
    while (this.time[this.start] < time_s - KEPT_S) this.start += 1;
  }

  #append(time_s, values) {
    if (this.end === CAPACITY) this.#compact();
    this.time[this.end] = time_s;
    for (const key of this.keys) this.columns[key][this.end] = values[key] ?? NaN;
    this.end += 1;
  }

  #compact() {
    const from = Math.max(this.start, CAPACITY >> 2);
    for (const column of [this.time, ...Object.values(this.columns)]) column.copyWithin(0, from, this.end);
    this.end -= from;
    this.start = 0;
  }

  /** First place whose time is not before `time_s`. */
  place(time_s) {
    let low = this.start;
    let high = this.end;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.time[middle] < time_s) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** An independent copy, for frozen plots. */
  copy() {
    const other = new History(this.keys);
    other.time.set(this.time);
    for (const key of this.keys) other.columns[key].set(this.columns[key]);
    other.start = this.start;
    other.end = this.end;
    return other;
  }
}

/**
 * Places of at most `most` samples of `column` in [from, to): the least and the greatest of each
 * stretch of time, so that no peak is lost. A break in the line (NaN) is kept.
 */
export function decimate(column, from, to, most) {
  const count = to - from;
  if (count <= most) return Array.from({ length: count }, (_, place) => from + place);
  const places = [];
  const stretches = most >> 1;
  for (let stretch = 0; stretch < stretches; stretch += 1) {
    const first = from + Math.floor((stretch * count) / stretches);
    const last = from + Math.floor(((stretch + 1) * count) / stretches);
    let least = first;
    let greatest = first;
    let broken = -1;
    for (let place = first; place < last; place += 1) {
      if (Number.isNaN(column[place])) broken = place;
      if (column[place] < column[least] || Number.isNaN(column[least])) least = place;
      if (column[place] > column[greatest] || Number.isNaN(column[greatest])) greatest = place;
    }
    if (broken >= 0) places.push(broken);
    if (least !== greatest) places.push(Math.min(least, greatest), Math.max(least, greatest));
    else if (least !== broken) places.push(least);
  }
  return places;
}
