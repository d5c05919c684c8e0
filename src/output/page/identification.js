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

function begin() {
  byId("title").replaceChildren(HEAD.name, element("small", { textContent: "identification" }));
  showFacts(HEAD.facts);
  fillParameters(HEAD.parameters);
  if (levels.length === 0) {
    byId("prediction").remove();
    return;
  }
  byId("motion").textContent = HEAD.motion;
  byId("step").textContent = quantityText(HEAD.levels[0].step, "s");
  byId("residuals").append(row("th", ["leg", "file RMS [N]", "largest", "identified RMS [N]", "largest", "correlation"]));
  byId("residuals").append(...HEAD.residuals.map((cells) => row("td", cells)));
  addFigures();
  watchKeys();
  watchSurroundings();
  showAll();
  setTimeout(() => setTime(0.5 * HEAD.length_s));
}
begin();
