// The page: range of time, instant, controls, themes, printing.

const byId = (id) => document.getElementById(id);
let range = { from: 0, to: Math.max(HEAD.length_s, HEAD.period_s) };
let now = 0;

function showFacts(facts) {
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
  const slider = byId("time");
  slider.min = range.from;
  slider.max = range.to;
  slider.step = Math.max(long / 1000, Math.min(HEAD.period_s, long / 100));
  byId("range").textContent = `Shown: ${begin.toFixed(3)} to ${range.to.toFixed(3)} s of ${whole.toFixed(3)} s`;
  drawCharts();
  drawTracks();
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

function setTime(t) {
  now = t;
  byId("time").value = t;
  byId("now").textContent = `${t.toFixed(4)} s`;
  byId("time").setAttribute("aria-valuetext", `${t.toFixed(4)} seconds`);
  moveCursors(t);
  drawScene(sampleAt(t));
  drawTracks();
  byId("interval").textContent = intervalText(t);
}

function zoom(factor) {
  const half = 0.5 * factor * (range.to - range.from);
  setRange(now - half, now + half);
}

function shift(share) {
  const by = share * (range.to - range.from);
  setRange(range.from + by, range.to + by);
}

// Plays in real time from the cursor to the end of the range; several seconds at least, so that a window is seen slowly.
const LEAST_PLAY_S = 6;
let playing = null;
function play() {
  const stop = () => {
    cancelAnimationFrame(playing);
    playing = null;
    byId("play").textContent = "Play";
    byId("play").setAttribute("aria-pressed", "false");
  };
  if (playing !== null) return stop();
  const long = range.to - range.from;
  const speed = Math.min(1, long / LEAST_PLAY_S);
  const from = now >= range.to - 1e-9 ? range.from : now;
  const began = performance.now();
  const step = () => {
    const t = from + ((performance.now() - began) / 1000) * speed;
    setTime(Math.min(t, range.to));
    if (t >= range.to) return stop();
    playing = requestAnimationFrame(step);
  };
  byId("play").textContent = "Pause";
  byId("play").setAttribute("aria-pressed", "true");
  playing = requestAnimationFrame(step);
}

function watchControls() {
  byId("time").addEventListener("input", (event) => setTime(Number(event.target.value)));
  const actions = {
    play, earlier: () => shift(-0.5), later: () => shift(0.5), closer: () => zoom(0.5), wider: () => zoom(2), whole: showAll,
  };
  for (const [id, action] of Object.entries(actions)) byId(id).addEventListener("click", action);
  const keys = { a: "earlier", d: "later", w: "closer", s: "wider", 0: "whole" };
  document.addEventListener("keydown", (event) => {
    if (keys[event.key] && !event.ctrlKey && !event.metaKey && !event.altKey) actions[keys[event.key]]();
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

function begin() {
  const recorded = new Date(1000 * HEAD.begin_s).toISOString().slice(0, 19).replace("T", " ");
  byId("title").replaceChildren(HEAD.name, element("small", { textContent: HEAD.is_live ? "live" : `${recorded} UTC` }));
  byId("configuration").textContent = HEAD.configuration;
  byId("kept").textContent = HEAD.kept === "" ? "" : `Of the samples, ${HEAD.kept}.`;
  showFacts(HEAD.facts);
  addFigures();
  watchControls();
  watchScene(() => drawScene(sampleAt(now)));
  watchTracks();
  watchSurroundings();
  if (HEAD.is_live) return follow();
  findLargestForce();
  showRange(0, HEAD.length_s);
  drawDistributions(HEAD.distributions);
  fillList();
  // uPlot draws at the end of the task.
  setTimeout(() => {
    setTime(0.5 * HEAD.length_s);
    document.body.dataset.openMs = performance.now().toFixed(0);
    document.body.dataset.charts = String(charts.length);
  });
}

window.addEventListener("error", (event) => {
  byId("error").hidden = false;
  byId("error").textContent = `this page has failed: ${event.message}`;
  document.body.dataset.error = event.message;
});
begin();
