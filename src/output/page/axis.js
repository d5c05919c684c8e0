// Linear axes of all charts: range, round ticks, numbers of one format, prefix of the unit. `axis.rs` computes the same for pictures.

// Values whose span is a smaller share of their size are constant: numbers of four bytes have seven digits.
const FLAT_SHARE = 1e-6;
// Values within this span are constant, and smaller values are zero: they are rounding errors.
const FLAT_SPAN = 1e-9;
// Largest ratio of a common axis to the range of a component that is readable on it.
const MAX_COMMON_RATIO = 20;
// Units that take prefixes, alone or divided by another one, each with its greatest power of ten.
const PREFIXED_UNITS = { m: 3, rad: 3, s: 0, N: 9 };
const PREFIXES = { "-12": "p", "-9": "n", "-6": "µ", "-3": "m", 3: "k", 6: "M", 9: "G" };

const isFlat = (low, high) => high - low <= Math.max(FLAT_SPAN, FLAT_SHARE * Math.max(Math.abs(low), Math.abs(high)));
const powerOfTen = (exponent) => `10${[...String(exponent)].map((c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]).join("")}`;

// Axis that covers a range and a margin as a share of it, with about so many ticks at most. The label is the quantity with its unit.
function axisOf(label, low, high, margin, count) {
  const size = Math.max(Math.abs(low), Math.abs(high));
  const around = size > FLAT_SPAN ? 0.05 * size : 1;
  const border = isFlat(low, high) ? around : margin * (high - low);
  [low, high] = [low - border, high + border];
  const rough = (high - low) / count;
  let power = Math.floor(Math.log10(rough));
  const lead = [1, 2, 5].find((it) => it * 10 ** power >= rough);
  if (!lead) power++;
  const step = (lead || 1) * 10 ** power;
  // A tick just outside is worth a hair of space.
  const [first, last] = [Math.ceil(low / step - 0.02), Math.floor(high / step + 0.02)];
  const ticks = Array.from({ length: last - first + 1 }, (_, k) => (first + k) * step);
  // 1099.995 mm rather than 1.099995 m.
  const exponent = Math.min(exponentOf(label, Math.max(Math.abs(first), Math.abs(last)) * step), power < -4 ? -3 : Infinity);
  const texts = ticks.map((tick) => fixed(tick / 10 ** exponent, Math.max(0, exponent - power)));
  return { low: Math.min(low, first * step), high: Math.max(high, last * step), ticks, texts, exponent, title: prefixed(label, exponent) };
}

// Whether components must have an axis each: a common one would hide the shape of one of them.
function needOwnAxes(ranges) {
  const common = Math.max(...ranges.map(([, high]) => high)) - Math.min(...ranges.map(([low]) => low));
  return ranges.some(([low, high]) => !isFlat(low, high) && common > MAX_COMMON_RATIO * (high - low));
}

// Power of ten to take out of numbers up to a size: if the unit takes prefixes, the largest number is from 1 to 1000; else only very
// large and very small numbers have one.
function exponentOf(label, size) {
  if (size < FLAT_SPAN) return 0;
  const order = Math.floor(Math.log10(size) + 1e-9);
  const thousands = 3 * Math.floor(order / 3);
  const greatest = greatestPrefix(label);
  if (greatest !== undefined) return Math.max(-12, Math.min(greatest, thousands));
  return -2 <= order && order < 6 ? 0 : thousands;
}

// Greatest power of ten of a prefix of the unit, if it takes any.
const greatestPrefix = (label) => PREFIXED_UNITS[(label.split("[")[1] || "").split(/[\/ \]]/)[0]];

// A label with a power of ten in its unit: `position [m]` as `position [mm]`, `angle [deg]` as `angle [10⁻³ deg]`.
function prefixed(label, exponent) {
  if (exponent === 0) return label;
  const prefix = greatestPrefix(label) !== undefined && PREFIXES[exponent];
  return label.includes("[") ? label.replace("[", `[${prefix || `${powerOfTen(exponent)} `}`) : `${label} [${powerOfTen(exponent)}]`;
}

// A number with so many digits after the point, and no negative zero.
const fixed = (number, digits) => (Number(number.toFixed(digits)) + 0).toFixed(digits).replace("-", "−");

// A quantity with the prefix of its unit and three digits.
function quantityText(value, unit) {
  const exponent = exponentOf(`[${unit}]`, Math.abs(value));
  return `${String(Number((value / 10 ** exponent).toPrecision(3)))} ${prefixed(`[${unit}]`, exponent).slice(1, -1)}`;
}
