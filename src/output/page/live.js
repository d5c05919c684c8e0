// Live: the server sends new samples and what has happened since the page was opened.

// How often the page requests what is new [ms], and what it keeps [s].
const POLL_MS = 200;
const KEPT_S = 120;
// Range of time that is shown as long as the user has not chosen one [s].
const FOLLOWED_S = 20;
// Longest time for a reply of hexad view [ms].
const REPLY_MS = 1000;

// Number of the run, which changes with the daemon.
let run = 0;
// Wall clock of the newest data, while there are no new ones.
let since = "";

function liveLevel(step) {
  const capacity = Math.ceil((2 * KEPT_S) / step);
  const columns = Array.from({ length: COLUMN_COUNT }, () => new Float32Array(capacity));
  return { from: 0, shift: 0.5 * step, step, samples: 0, capacity, columns, next: 0 };
}

// Appends samples, row by row, that begin at a number; drops the oldest half when there is no room.
function append(level, first, text) {
  const rows = decoded(text);
  const count = rows.length / COLUMN_COUNT;
  if (level.samples === 0) level.from = first * level.step;
  let skipped = first - level.next;
  if (level.samples + count + Math.max(0, skipped) > level.capacity) {
    const dropped = Math.min(level.samples, Math.floor(level.capacity / 2));
    level.columns.forEach((column) => column.copyWithin(0, dropped, level.samples));
    level.from += dropped * level.step;
    level.samples -= dropped;
  }
  if (level.samples === 0) {
    level.from = first * level.step;
    skipped = 0;
  }
  for (; skipped > 0 && level.samples < level.capacity; skipped--, level.samples++) {
    level.columns.forEach((column) => { column[level.samples] = NaN; });
  }
  for (let row = 0; row < count && level.samples < level.capacity; row++, level.samples++) {
    level.columns.forEach((column, k) => { column[level.samples] = rows[row * COLUMN_COUNT + k]; });
  }
  level.next = first + count;
}

async function poll() {
  const token = new URLSearchParams(location.search).get("token");
  const after = levels.length > 0 ? levels[0].next : 0;
  const reply = await fetch(`data?token=${token}&after=${after}`, { cache: "no-store", signal: AbortSignal.timeout(REPLY_MS) });
  if (!reply.ok) throw new Error(`the server replied ${reply.status}`);
  const fresh = await reply.json();
  if (levels.length === 0 || fresh.run !== run) {
    // Another daemon: its samples count from zero again.
    const isEmpty = levels.length === 0;
    levels = [liveLevel(fresh.step_s)];
    run = fresh.run;
    // Its state replaces the old one at once.
    if (!isEmpty) return poll();
  }
  if (fresh.samples !== "") append(levels[0], fresh.first, fresh.samples);
  // To the last whole sample.
  HEAD.length_s = Math.max(HEAD.period_s, levels[0].next * levels[0].step);
  tracks = fresh.tracks;
  rows = fresh.rows;
  showFacts(fresh.facts);
  return fresh;
}

// Shows the age of the newest data, of this instant of the page [ms], and why there are none, if so.
function showAge(newest, cause) {
  const age = (performance.now() - newest) / 1000;
  since = cause && (since || new Date(Date.now() - 1000 * age).toTimeString().slice(0, 8));
  document.body.classList.toggle("stale", cause !== "");
  document.title = `${HEAD.name}: ${cause ? "no new data" : "live"}`;
  byId("title").lastChild.textContent = `${cause ? "not live, no new data for" : "live, newest data"} ${age.toFixed(1)} s${cause ? "" : " old"}`;
  const text = cause && `No new data since ${since}: ${cause}. What is grey is old.`;
  const error = byId("error");
  // A screen reader reads each change.
  if (error.textContent !== text) error.textContent = text;
  error.hidden = !cause;
}

// Draws what is new; a chart whose window is hidden waits.
async function follow() {
  let [redrawn, newest, cause] = [0, performance.now(), ""];
  for (;;) {
    try {
      const fresh = await poll();
      findLargestForce();
      if (isFollowed && !document.hidden) {
        showRange(Math.max(0, HEAD.length_s - FOLLOWED_S), HEAD.length_s);
        setTime(HEAD.length_s);
      }
      if (redrawn++ % 10 === 0) {
        separateComponents();
        drawDistributions(fresh.distributions);
        fillList();
      }
      [newest, cause] = [performance.now() - 1000 * fresh.age_s, fresh.silence];
    } catch (failure) {
      cause = `this page can show no reply of hexad view, which has ended, is paused or failed (${failure.message})`;
    }
    showAge(newest, cause);
    document.body.dataset.result = JSON.stringify({
      samples: levels[0]?.samples, charts: panels.length, state: intervalText(HEAD.length_s).split(" · ")[0],
      error: document.body.dataset.error || null, age: byId("title").lastChild.textContent, alert: byId("error").textContent,
      opacity: getComputedStyle(byId("facts")).opacity,
    });
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
  }
}
