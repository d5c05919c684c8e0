// What all pages have in common: range of time, instant, keys, themes, printing. The script of each kind of page draws what
// else follows the range and the instant: `rangeChanged`, `instantChanged`.

const byId = (id) => document.getElementById(id);
let range = { from: 0, to: Math.max(HEAD.length_s, HEAD.period_s) };
let now = 0;
// Whether the range follows new samples.
let isFollowed = HEAD.is_live;

function showFacts(facts) {
  // The same as plain text, for what runs no script.
  byId("summary")?.remove();
  byId("facts").replaceChildren(...facts.flatMap(({ name, text, is_bad }) => [
    element("dt", { textContent: name }), element("dd", { textContent: text, className: is_bad ? "bad" : "" }),
  ]));
}

// Shows a range of time, at least some cycles and at most the recording.
function showRange(from, to) {
  const whole = Math.max(HEAD.length_s, HEAD.period_s);
  const long = Math.min(whole, Math.max(to - from, 4 * HEAD.period_s));
  const begin = Math.min(Math.max(0, from), whole - long);
  range = { from: begin, to: begin + long };
  drawCharts();
  rangeChanged(whole);
}

function setRange(from, to) {
  isFollowed = false;
  showRange(from, to);
  setTime(Math.min(range.to, Math.max(range.from, now)));
}

function showAll() {
  isFollowed = HEAD.is_live;
  if (!isFollowed) setRange(0, HEAD.length_s);
}

// Time of day of an instant of a recording, as in the log; empty on other pages.
function clock(t) {
  return HEAD.begin_s > 0 ? `${new Date(1000 * (HEAD.begin_s + t)).toISOString().slice(11, 23)} UTC` : "";
}

function setTime(t) {
  now = t;
  byId("now").textContent = [`${t.toFixed(4)} s`, clock(t)].filter(Boolean).join(", ");
  moveCursors(t);
  instantChanged(t);
}

function zoom(factor) {
  const half = 0.5 * factor * (range.to - range.from);
  setRange(now - half, now + half);
}

function shift(share) {
  const by = share * (range.to - range.from);
  setRange(range.from + by, range.to + by);
}

const ACTIONS = {
  earlier: () => shift(-0.5), later: () => shift(0.5), closer: () => zoom(0.5), wider: () => zoom(2), whole: () => showAll(),
};

function watchKeys() {
  const keys = { a: "earlier", d: "later", w: "closer", s: "wider", 0: "whole" };
  document.addEventListener("keydown", (event) => {
    if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) ACTIONS[keys[event.key]]();
  });
}

function redraw() {
  resizeCharts();
  charts.forEach(({ chart }) => chart.redraw());
  if (distributionChart) {
    distributionChart.chart.setSize({ width: distributionChart.plot.clientWidth, height: distributionChart.chart.height });
    distributionChart.chart.redraw();
  }
  // uPlot sets sizes at the end of the task.
  queueMicrotask(() => setTime(now));
}

// Paper is white and narrow.
function watchSurroundings() {
  window.addEventListener("resize", redraw);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  window.addEventListener("beforeprint", () => {
    document.documentElement.dataset.theme = "light";
    document.body.classList.add("paper");
    redraw();
  });
  window.addEventListener("afterprint", () => {
    delete document.documentElement.dataset.theme;
    document.body.classList.remove("paper");
    redraw();
  });
}

window.addEventListener("error", (event) => {
  byId("error").hidden = false;
  byId("error").textContent = `this page has failed: ${event.message}`;
  document.body.dataset.error = event.message;
});
