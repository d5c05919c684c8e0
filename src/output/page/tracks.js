// Tracks: intervals along the time axis, below each other, aligned with the charts.

const ROW_PX = 20;
// Height of a name above its row where it has no room beside it.
const NAME_PX = 16;
const HEAD_PX = 4;
const SCALE_PX = 20;
const LEGEND_PX = 224;
// An interval is at least so wide, so that a single cycle is seen.
const LEAST_PX = 2;

let tracks = HEAD.tracks;
let rows = HEAD.rows;

function intervalColor(track, interval) {
  if (track.group === "state") return color(HEAD.states[interval.key]);
  if (track.group === "configuration") return color(interval.key % 2 === 1 ? "stopping" : "accent");
  if (track.group === "diagnostic") return interval.key % 1000 >= 100 ? color("fault") : color("engaging");
  if (["late wake-up", "inputs late"].includes(track.name)) return color("engaging");
  if (track.group === "missed deadlines" || track.group === "recording") return color("fault");
  return track.group === "requests" ? color("accent") : color("stopping");
}

// As the legends of the charts, which are below them on a narrow screen.
const isNarrow = () => matchMedia("screen and (max-width: 700px)").matches;

function plotWidth(canvas) {
  return Math.max(100, canvas.clientWidth - Y_AXIS_PX - (isNarrow() ? 0 : LEGEND_PX) - RIGHT_PX);
}

const trackX = (t, width) => Y_AXIS_PX + ((t - range.from) / (range.to - range.from)) * width;

function drawTracks() {
  const canvas = document.getElementById("tracks");
  const row = ROW_PX + (isNarrow() ? NAME_PX : 0);
  const height = HEAD_PX + tracks.length * row + SCALE_PX;
  canvas.style.height = `${height}px`;
  const ratio = window.devicePixelRatio || 1;
  canvas.width = Math.round(canvas.clientWidth * ratio);
  canvas.height = Math.round(height * ratio);
  const pen = canvas.getContext("2d");
  pen.scale(ratio, ratio);
  pen.font = "12px system-ui, sans-serif";
  pen.textBaseline = "middle";
  const width = plotWidth(canvas);
  tracks.forEach((track, k) => drawTrack(pen, track, HEAD_PX + (k + 1) * row - ROW_PX, width));
  drawScale(pen, height - SCALE_PX, width);
  drawNow(pen, height - SCALE_PX, width);
}

function drawTrack(pen, track, top, width) {
  pen.fillStyle = color("panel");
  pen.fillRect(Y_AXIS_PX, top + 1, width, ROW_PX - 3);
  pen.save();
  pen.beginPath();
  pen.rect(Y_AXIS_PX, top, width, ROW_PX);
  pen.clip();
  for (const interval of track.intervals) {
    if (interval.to < range.from || interval.from > range.to) continue;
    const [left, right] = [trackX(interval.from, width), trackX(interval.to + HEAD.period_s, width)];
    const long = Math.max(LEAST_PX, right - left);
    pen.fillStyle = intervalColor(track, interval);
    pen.fillRect(left, top + 1, long, ROW_PX - 3);
    const shownLeft = Math.max(left, Y_AXIS_PX);
    const room = Math.min(left + long, Y_AXIS_PX + width) - shownLeft - 10;
    if (["state", "configuration", "diagnostic"].includes(track.group) && pen.measureText(interval.text).width < room) {
      pen.fillStyle = "#ffffff";
      pen.fillText(interval.text, shownLeft + 5, top + ROW_PX / 2);
    }
  }
  pen.restore();
  pen.fillStyle = color("ink");
  pen.textAlign = "left";
  const name = track.group === "limits reached" ? `limit: ${track.name}` : track.name;
  const count = track.group === "missed deadlines" ? `  ${track.count}` : "";
  const [x, y] = isNarrow() ? [Y_AXIS_PX, top - NAME_PX / 2] : [Y_AXIS_PX + width + RIGHT_PX + 8, top + ROW_PX / 2];
  pen.fillText(name + count, x, y);
}

function drawScale(pen, top, width) {
  const { ticks, texts, title } = axisOf("time [s]", range.from, range.to, 0, Math.max(2, width / 70));
  pen.textAlign = "center";
  ticks.forEach((tick, k) => {
    const x = trackX(tick, width);
    pen.fillStyle = color("edge");
    pen.fillRect(x, top, 1, 4);
    pen.fillStyle = color("ink");
    pen.fillText(texts[k], x, top + 12);
  });
  pen.textAlign = "left";
  if (!isNarrow()) pen.fillText(title, Y_AXIS_PX + width + RIGHT_PX + 8, top + 12);
}

function drawNow(pen, height, width) {
  const x = trackX(now, width);
  if (x < Y_AXIS_PX || x > Y_AXIS_PX + width) return;
  pen.fillStyle = color("ink");
  pen.fillRect(x, 0, 1, height);
}

// The intervals of all tracks at an instant, in words.
function intervalText(t) {
  const slack = ((range.to - range.from) / 800) * LEAST_PX;
  const at = tracks.flatMap((track) => track.intervals
    .filter((it) => it.from - slack <= t && t <= it.to + HEAD.period_s + slack)
    .slice(-1)
    .map((it) => (track.group === "limits reached" ? `limit: ${it.text}` : it.text)));
  return at.join(" · ");
}

// Beginning of the first fault.
function firstFault() {
  const states = tracks.filter((track) => track.group === "state").flatMap((track) => track.intervals);
  return states.find((it) => HEAD.states[it.key] === "fault")?.from;
}

function fillList() {
  const table = document.getElementById("intervals");
  table.replaceChildren(element("tr", {}, ...["from [s]", "to [s]", "", "", ""].map((text) => element("th", { textContent: text }))));
  for (const { from, to, name, text } of rows) {
    const button = element("button", { type: "button", textContent: from.toFixed(3), title: "Show it" });
    button.addEventListener("click", () => {
      const border = Math.max(to - from, 100 * HEAD.period_s);
      setRange(from - border, to + border);
      setTime(from);
    });
    const cells = [element("td", {}, button), to.toFixed(3), clock(from), name, text];
    table.append(element("tr", {}, cells[0], ...cells.slice(1).map((text) => element("td", { textContent: text }))));
  }
}

function watchTracks() {
  const canvas = document.getElementById("tracks");
  const timeAt = (event) => range.from + ((event.offsetX - Y_AXIS_PX) / plotWidth(canvas)) * (range.to - range.from);
  canvas.addEventListener("pointermove", (event) => {
    const t = timeAt(event);
    if (t >= range.from && t <= range.to) setTime(t);
  });
  canvas.addEventListener("dblclick", () => showAll());
}
