// The page of an identification: change of each parameter, forces and residuals over time.

const LEGS = ["leg 1", "leg 2", "leg 3", "leg 4", "leg 5", "leg 6"];
const FIGURES = LEGS.map((name, k) => ({ title: `Force of ${name}, recorded and predicted`, panels: [
  { label: "force [N]", names: ["recorded", "file", "identified"], signal: `leg_${k + 1}`, dashed: 2, isCompared: true },
] })).concat([
  { title: "Residuals with the file: recorded less predicted force", panels: [{ label: "residual [N]", names: LEGS, signal: "residual_before" }] },
  { title: "Residuals with the identified values, on a scale of their own", panels: [{ label: "residual [N]", names: LEGS, signal: "residual_after" }] },
]);

function rangeChanged() {}
function instantChanged() {}

function row(kind, cells) {
  return element("tr", {}, ...cells.map((cell) => element(kind, {}, cell)));
}

// Change of a parameter with its deviation, on an axis from -limit to limit.
function changeBar({ change, deviation }, limit) {
  const place = (value) => `${50 + (50 * value) / limit}%`;
  const line = element("i");
  line.style.left = place(change - deviation);
  line.style.width = `${(100 * deviation) / limit}%`;
  const point = element("b");
  point.style.left = place(change);
  return element("div", { className: "bar" }, line, point);
}

function fillParameters(parameters) {
  const limit = Math.max(1, ...parameters.map(({ change, deviation }) => Math.ceil(Math.abs(change) + deviation)));
  const table = byId("parameters");
  table.style.setProperty("--limit", limit);
  const scale = element("div", { className: "scale" }, ...[`−${limit}`, "0", `+${limit}`].map((text) => element("span", {}, text)));
  table.append(row("th", ["parameter", scale, "file", "identified", "deviation", "shown by"]));
  for (const it of parameters) {
    const [name, ...numbers] = it.cells;
    const made = row("td", [name, changeBar(it, limit), ...numbers]);
    made.className = it.is_shown ? "" : "hollow";
    table.append(made);
  }
}

// Means of residuals in bins, with bars of two deviations, between -limit and limit.
function dependencePlot(title, unit, bins, limit) {
  const [least, most] = [bins[0][0], bins[bins.length - 1][0]];
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", "0 0 200 80");
  svg.setAttribute("preserveAspectRatio", "none");
  const line = (kind, x1, y1, x2, y2) => {
    const made = document.createElementNS("http://www.w3.org/2000/svg", "line");
    made.setAttribute("class", kind);
    Object.entries({ x1, y1, x2, y2 }).forEach(([name, value]) => made.setAttribute(name, value));
    svg.append(made);
  };
  const x = (value) => 5 + (190 * (value - least)) / (most - least || 1);
  const y = (value) => 40 - (38 * value) / limit;
  line("zero", 0, 40, 200, 40);
  if (least < 0 && most > 0) line("zero", x(0), 0, x(0), 80);
  bins.forEach(([place, mean, deviation]) => {
    line("spread", x(place), y(mean - 2 * deviation), x(place), y(mean + 2 * deviation));
    line("mean", x(place) - 3, y(mean), x(place) + 3, y(mean));
  });
  const ends = [least, most].map((value) => element("span", {}, `${value.toFixed(2)} ${unit}`));
  return element("figure", {}, element("figcaption", {}, title), svg, element("div", { className: "scale" }, ...ends));
}

function fillDependence(legs) {
  const limit = Math.max(...legs.flat(2).map(([, mean, deviation]) => Math.abs(mean) + 2 * deviation));
  byId("dependence-limit").textContent = quantityText(limit, "N");
  legs.forEach(([lengths, rates], leg) => {
    if (lengths.length === 0) return;
    byId("dependence").append(dependencePlot(`leg ${leg + 1}, length`, "m", lengths, limit));
    byId("dependence").append(dependencePlot(`leg ${leg + 1}, rate`, "m/s", rates, limit));
  });
}

function begin() {
  byId("title").replaceChildren(HEAD.name, element("small", { textContent: "identification" }));
  showFacts(HEAD.facts);
  fillParameters(HEAD.parameters);
  if (levels.length === 0) {
    byId("prediction").remove();
    byId("dependence-section").remove();
    return;
  }
  byId("motion").textContent = HEAD.motion;
  byId("step").textContent = quantityText(HEAD.levels[0].step, "s");
  byId("residuals").append(row("th", ["leg", "file RMS [N]", "largest", "identified RMS [N]", "largest", "correlation"]));
  byId("residuals").append(...HEAD.residuals.map((cells) => row("td", cells)));
  fillDependence(HEAD.dependence);
  addFigures();
  watchKeys();
  watchSurroundings();
  showAll();
  setTimeout(() => setTime(0.5 * HEAD.length_s));
}
begin();
