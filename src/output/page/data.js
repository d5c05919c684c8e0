"use strict";
// The samples of the page: levels of different fineness, from which each view takes what it can show.

const HEAD = JSON.parse(document.getElementById("head").textContent);
const COLUMN_COUNT = HEAD.column_count;
// Samples for a view: two for each pixel of a wide chart.
const VIEW_SAMPLES = 2400;

// Numbers of four bytes from base64.
function decoded(text) {
  const characters = atob(text);
  const bytes = new Uint8Array(characters.length);
  for (let k = 0; k < bytes.length; k++) bytes[k] = characters.charCodeAt(k);
  return new Float32Array(bytes.buffer);
}

// A level: samples at from + k step, a Float32Array for each column.
function decodedLevels() {
  const numbers = decoded(document.getElementById("samples").textContent);
  let offset = 0;
  return HEAD.levels.map((level) => {
    const columns = [];
    for (let k = 0; k < COLUMN_COUNT; k++, offset += level.samples) {
      columns.push(numbers.subarray(offset, offset + level.samples));
    }
    // A sample of one cycle is at its instant, a sample of several in the middle of its cycles.
    const shift = level.step > 1.5 * HEAD.period_s ? 0.5 * level.step : 0;
    return { from: level.from, shift, step: level.step, samples: level.samples, columns };
  });
}

let levels = decodedLevels();

const end = (level) => level.from + level.step * level.samples;

// Levels by suitability for samples at a distance: the coarsest that is fine enough, else the finest.
function bySuitability(distance) {
  const fine = levels.filter((level) => level.step <= distance).sort((a, b) => b.step - a.step);
  const coarse = levels.filter((level) => level.step > distance).sort((a, b) => a.step - b.step);
  return fine.concat(coarse);
}

// Pieces of levels, in order, that cover a range of time; { level, first, last } with samples first..last - 1.
function pieces(from, to) {
  const found = [];
  let free = [[from, to]];
  for (const level of bySuitability((to - from) / VIEW_SAMPLES)) {
    const rest = [];
    for (const [a, b] of free) {
      const [low, high] = [Math.max(a, level.from), Math.min(b, end(level))];
      if (low >= high) {
        rest.push([a, b]);
        continue;
      }
      const first = Math.max(0, Math.floor((low - level.from) / level.step) - 1);
      const last = Math.min(level.samples, Math.ceil((high - level.from) / level.step) + 1);
      found.push({ level, first, last });
      if (a < low) rest.push([a, low]);
      if (high < b) rest.push([high, b]);
    }
    free = rest;
  }
  return found.sort((a, b) => a.level.from + a.first * a.level.step - b.level.from - b.first * b.level.step);
}

// Instants of the samples of pieces, ascending: where pieces overlap by a sample the later piece gives way.
function view(from, to) {
  const times = [];
  const parts = [];
  for (const { level, first, last } of pieces(from, to)) {
    let begin = first;
    const latest = times.length > 0 ? times[times.length - 1] : -Infinity;
    while (begin < last && level.from + level.shift + begin * level.step <= latest) begin++;
    for (let k = begin; k < last; k++) times.push(level.from + level.shift + k * level.step);
    parts.push({ level, first: begin, last });
  }
  return { times, parts };
}

// A column of a view; null where there is no number.
function columnOf({ times, parts }, column) {
  const numbers = new Array(times.length);
  let next = 0;
  for (const { level, first, last } of parts) {
    const from = level.columns[column];
    for (let k = first; k < last; k++) {
      const number = from[k];
      numbers[next++] = number === number ? number : null;
    }
  }
  return numbers;
}

// The finest sample at an instant: a function from column to number.
function sampleAt(t) {
  const levelsThere = levels.filter((level) => level.from <= t && t < end(level));
  const finest = levelsThere.sort((a, b) => a.step - b.step)[0] || levels[levels.length - 1];
  if (!finest || finest.samples === 0) return () => NaN;
  const nearest = Math.round((t - finest.from - finest.shift) / finest.step);
  const k = Math.min(finest.samples - 1, Math.max(0, nearest));
  return (column) => finest.columns[column][k];
}

// Components of a signal at an instant.
function signalAt(sample, name, count) {
  const first = HEAD.columns[name];
  return Array.from({ length: count }, (_, k) => sample(first + k));
}

// A number as people read it: four digits, four at most after the point, and at least so many.
function rounded(number, least = 0) {
  if (number === null || number !== number) return "–";
  const size = Math.abs(number);
  const digits = size >= 1000 ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : size >= 1 ? 3 : 4;
  return fixed(number, Math.max(digits, least));
}
