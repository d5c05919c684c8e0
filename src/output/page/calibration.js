// The page of a calibration: residuals of rows, error maps, shifts of the joints.

function rangeChanged() {}
function instantChanged() {}

const COLOURS = [0, 1, 2, 3, 4, 5].map((leg) => `var(--c${leg})`);
const AXIS_NAMES = ["x", "y", "z"];

function picture(id, title, width, height, shapes) {
  const svg = document.createElementNS("http://www.w3.org/2000/svg", "svg");
  svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
  for (const [kind, attributes, text] of shapes) {
    const shape = document.createElementNS("http://www.w3.org/2000/svg", kind);
    Object.entries(attributes).forEach(([name, value]) => shape.setAttribute(name, value));
    if (text) shape.textContent = text;
    svg.append(shape);
  }
  byId(id).append(element("figure", {}, element("figcaption", {}, title), svg));
}

const label = (x, y, text, anchor = "start") => ["text", { x, y, "text-anchor": anchor }, text];

function drawRows(title, of) {
  const limit = Math.max(1e-9, ...HEAD.rows.filter((row) => !row.is_suspected).flatMap((row) => of(row).map(Math.abs)));
  const x = (k) => 10 + (480 * (k + 0.5)) / HEAD.rows.length;
  const y = (value) => 90 - 80 * Math.max(-1.05, Math.min(1.05, value / limit));
  const shapes = [["line", { x1: 10, x2: 490, y1: 90, y2: 90, class: "zero" }]];
  HEAD.rows.forEach((row, k) => of(row).forEach((value, leg) => {
    const place = { fill: COLOURS[leg], stroke: COLOURS[leg] };
    shapes.push(row.is_suspected
      ? ["path", { ...place, d: `M${x(k) - 4} ${y(value) - 4}l8 8m0 -8l-8 8` }]
      : ["circle", { ...place, cx: x(k), cy: y(value), r: 2 }]);
  }));
  picture("rows", `${title}, ±${quantityText(limit, "m")}`, 500, 180, shapes);
}

function drawMap({ axes, ranges, cells }, which, title) {
  const side = Math.sqrt(cells.length);
  const limit = Math.max(...cells.filter(Boolean).map((cell) => cell[which]));
  const size = 220 / side;
  const shapes = cells.flatMap((cell, k) => cell ? [["rect", {
    x: 30 + size * (k % side), y: 236 - size * (1 + Math.floor(k / side)), width: size, height: size,
    "shape-rendering": "crispEdges", fill: "var(--accent)", "fill-opacity": (0.06 + (0.94 * cell[which]) / limit).toFixed(3),
  }]] : []);
  const end = (value, axis) => quantityText(value, axis.length > 1 ? "rad" : "m");
  shapes.push(label(30, 251, end(ranges[0][0], axes[0])), label(250, 251, end(ranges[0][1], axes[0]), "end"), label(140, 251, axes[0], "middle"));
  shapes.push(label(30, 11, `${axes[1]} up to ${end(ranges[1][1], axes[1])}, from ${end(ranges[1][0], axes[1])}`));
  picture("maps", `${title}, up to ${quantityText(limit, "m")}`, 260, 258, shapes);
}

function drawJoints(joints, title) {
  const extent = Math.max(...joints.flatMap(([place]) => place.map(Math.abs)), 1e-9);
  const largest = Math.max(...joints.map(([, shift]) => Math.hypot(...shift)), 1e-12);
  const wanted = (0.4 * extent) / largest;
  const decade = 10 ** Math.floor(Math.log10(wanted));
  const factor = decade * [5, 2, 1].find((step) => step * decade <= wanted);
  [[0, 1], [0, 2], [1, 2]].forEach(([a, b]) => {
    const middle = [a, b].map((axis) => joints.reduce((sum, [place]) => sum + place[axis] / joints.length, 0));
    const at = (place, shift, k) => 125 + (k ? -1 : 1) * (85 / extent) * (place[[a, b][k]] - middle[k] + shift[[a, b][k]] * (factor - 1));
    const shapes = joints.flatMap(([place, shift], leg) => {
      const drawn = place.map((value, axis) => value - shift[axis]);
      const [x1, y1] = [0, 1].map((k) => at(drawn, [0, 0, 0], k));
      const [x2, y2] = [0, 1].map((k) => at(place, shift, k));
      return [
        ["line", { x1, y1, x2, y2, stroke: COLOURS[leg], "stroke-width": 2 }],
        ["circle", { cx: x1, cy: y1, r: 5, fill: "none", stroke: COLOURS[leg] }],
        ["circle", { cx: x2, cy: y2, r: 3, fill: COLOURS[leg] }],
        label(x1 + 7, y1 - 5, `${leg + 1}`),
      ];
    });
    shapes.push(label(125, 246, `${AXIS_NAMES[a]} to the right, ${AXIS_NAMES[b]} up`, "middle"));
    picture("joints", `${title}, ${factor} times, at most ${quantityText(largest, "m")}`, 250, 250, shapes);
  });
}

function begin() {
  byId("title").replaceChildren(HEAD.name, element("small", { textContent: "calibration" }));
  showFacts(HEAD.facts);
  drawRows("With the drawing", (row) => row.legs_before_m);
  drawRows("Calibrated", (row) => row.legs_m);
  HEAD.maps.forEach((map) => ["drawing", "calibrated"].forEach((name, which) => {
    if (map.cells.some(Boolean)) drawMap(map, which, `${map.axes.join("-")}, ${name}`);
  }));
  drawJoints(HEAD.joints[0], "Base");
  drawJoints(HEAD.joints[1], "Platform");
}
begin();
