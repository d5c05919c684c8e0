// The page of a run: slider, player, scene, tracks and charts.

function rangeChanged(whole) {
  const { from, to } = range;
  const slider = byId("time");
  slider.min = from;
  slider.max = to;
  slider.step = Math.max((to - from) / 1000, Math.min(HEAD.period_s, (to - from) / 100));
  byId("range").textContent = `Shown: ${from.toFixed(3)} to ${to.toFixed(3)} s of ${whole.toFixed(3)} s`;
  drawTracks();
}

function instantChanged(t) {
  byId("time").value = t;
  byId("time").setAttribute("aria-valuetext", `${t.toFixed(4)} seconds`);
  drawScene(sampleAt(t));
  drawTracks();
  byId("interval").textContent = intervalText(t);
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
  for (const [id, action] of Object.entries({ play, ...ACTIONS })) byId(id).addEventListener("click", action);
  watchKeys();
}

function begin() {
  const recorded = new Date(1000 * HEAD.begin_s).toISOString().slice(0, 19).replace("T", " ");
  const ending = HEAD.is_unfinished ? ", unfinished" : "";
  byId("title").replaceChildren(HEAD.name, element("small", { textContent: HEAD.is_live ? "live" : `${recorded} UTC${ending}` }));
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
    setTime(firstFault() ?? 0.5 * HEAD.length_s);
    document.body.dataset.openMs = performance.now().toFixed(0);
    document.body.dataset.charts = String(charts.length);
  });
}
begin();
