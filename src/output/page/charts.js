// Charts over time. All share the range of time and the instant of the cursor.

const Y_AXIS_PX = 78;
const RIGHT_PX = 22;
const CHART_HEIGHT_PX = 190;
const charts = [];

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

// Values that differ by less than this share of their size are equal: numbers of four bytes have seven digits.
const EQUAL_SHARE = 1e-6;
// Smaller values are rounding errors.
const LEAST_VALUE = 1e-9;

// Range of the values with a border; a band around a constant.
function valueRange(_, low, high) {
  if (low === null || high === null || low === undefined) return [0, 1];
  const size = Math.max(Math.abs(low), Math.abs(high));
  if (size < LEAST_VALUE) return [-1, 1];
  const border = high - low < EQUAL_SHARE * size ? 0.05 * size : 0.06 * (high - low);
  return [low - border, high + border];
}

function axes(label) {
  const values = (_, ticks) => ticks.map(tickText);
  const common = {
    stroke: () => color("ink"), font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif",
    grid: { stroke: () => color("grid"), width: 1 }, ticks: { stroke: () => color("grid"), width: 1, size: 5 },
  };
  return [
    { ...common, values, label: "time [s]", labelSize: 18, size: 30, labelGap: 0 },
    { ...common, values, label, labelSize: 18, size: Y_AXIS_PX - 18, labelGap: 2 },
  ];
}

// Text of a tick, without the rounding errors of its sum.
function tickText(number) {
  const size = Math.abs(number);
  if (size >= 1e6 || (size > 0 && size < 1e-4)) return number.toExponential(1).replace("-", "−");
  return String(Number(number.toFixed(6))).replace("-", "−");
}

// Series of a panel: first what was measured or applied, then the references on top of them.
function seriesOf(panel) {
  const first = HEAD.columns[panel.signal];
  const measured = panel.names.map((name, k) => ({
    column: first + k, color: k + (panel.color || 0), label: name, width: 2, stroke: () => color(`c${k + (panel.color || 0)}`),
  }));
  if (!panel.reference) return measured;
  const reference = HEAD.columns[panel.reference];
  return measured.concat(panel.names.map((name, k) => ({
    column: reference + k, label: `${name}, reference`, width: 1, dash: [4, 4], stroke: () => color("ink"), alpha: 0.8,
  })));
}

// Legend with the values at the cursor; its buttons hide a component.
function legendOf(panel, series, toggle) {
  const table = element("table", { className: "legend" });
  const head = element("tr", {}, element("th"), element("th", { textContent: panel.reference ? "actual" : "" }));
  if (panel.reference) {
    const dashed = element("span", { className: "swatch dashed" });
    head.append(element("th", {}, dashed, " ref."));
  }
  table.append(head);
  const rows = panel.names.map((name, k) => {
    const swatch = element("span", { className: "swatch" });
    swatch.style.color = `var(--c${k + (panel.color || 0)})`;
    const button = element("button", { type: "button", title: `Show or hide ${name}` }, swatch, name);
    button.setAttribute("aria-pressed", "true");
    button.addEventListener("click", () => {
      const shown = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(shown));
      toggle(k, shown);
    });
    const cells = [element("td")].concat(panel.reference ? [element("td")] : []);
    table.append(element("tr", {}, element("td", {}, button), ...cells));
    return cells;
  });
  const least = { "[m]": HEAD.machine.m_digits, "[deg]": HEAD.machine.deg_digits }[panel.label.split(" ").pop()];
  const show = (sample) => rows.forEach((cells, k) => cells.forEach((cell, which) => {
    cell.textContent = rounded(sample(series[k + which * panel.names.length].column), least);
  }));
  return { table, show };
}

function addChart(section, panel) {
  const series = seriesOf(panel);
  const plot = element("div", { className: "plot" });
  const box = element("div", { className: "chart" }, plot);
  section.append(box);
  const options = {
    width: plot.clientWidth || 600, height: CHART_HEIGHT_PX, legend: { show: false }, axes: axes(panel.label),
    scales: { x: { time: false, range: () => [range.from, range.to] }, y: { range: valueRange } },
    series: [{}].concat(series.map((it) => ({ ...it, points: { show: false }, spanGaps: false }))),
    cursor: {
      y: false, points: { show: false }, drag: { x: true, y: false, setScale: false },
      bind: { dblclick: () => () => showAll() },
    },
    padding: [8, RIGHT_PX, 0, 0],
    hooks: { setSelect: [(chart) => zoomTo(chart)] },
  };
  const chart = new uPlot(options, [[], ...series.map(() => [])], plot);
  // The pointer over a chart moves the instant of the page.
  chart.over.addEventListener("mousemove", (event) => setTime(chart.posToVal(event.offsetX, "x")));
  const toggle = (k, show) => {
    chart.setSeries(k + 1, { show });
    if (panel.reference) chart.setSeries(k + 1 + panel.names.length, { show });
  };
  const legend = legendOf(panel, series, toggle);
  box.append(legend.table);
  charts.push({ chart, plot, series, legend });
}

function addFigures() {
  const figures = document.getElementById("figures");
  for (const figure of FIGURES) {
    const section = element("section", {}, element("h2", { textContent: figure.title }));
    figures.append(section);
    figure.panels.forEach((panel) => addChart(section, panel));
  }
}

function zoomTo(chart) {
  const { left, width } = chart.select;
  if (width < 4) return;
  const [from, to] = [chart.posToVal(left, "x"), chart.posToVal(left + width, "x")];
  chart.setSelect({ left: 0, width: 0, top: 0, height: 0 }, false);
  setRange(from, to);
}

function drawCharts() {
  const seen = view(range.from, range.to);
  for (const { chart, series } of charts) {
    chart.setData([seen.times, ...series.map(({ column }) => columnOf(seen, column))]);
  }
}

function moveCursors(t) {
  const sample = sampleAt(t);
  const share = (t - range.from) / (range.to - range.from);
  for (const { chart, legend } of charts) {
    legend.show(sample);
    // Not by the scale of the chart, which changes only when it is drawn.
    chart.setCursor({ left: (share * chart.bbox.width) / uPlot.pxRatio, top: 0 }, false);
  }
}

function resizeCharts() {
  for (const { chart, plot } of charts) {
    if (plot.clientWidth > 0) chart.setSize({ width: plot.clientWidth, height: chart.height });
  }
}

// Distributions of the times: how many cycles in each bar, both axes logarithmic.
let distributionChart = null;
function drawDistributions(distributions) {
  const section = document.getElementById("distributions");
  section.querySelectorAll(".chart, .table").forEach((old) => old.remove());
  if (distributionChart) distributionChart.chart.destroy();
  distributionChart = null;
  const ends = [...new Set(distributions.flatMap((it) => it.bars.map(([at]) => at)))].sort((a, b) => a - b);
  if (ends.length > 0) distributionChart = distributionOf(section, distributions, ends);
  section.append(percentiles(distributions));
}

// Least number on the axis: nothing is drawn below one cycle.
const LEAST_COUNT = 0.7;

function distributionOf(section, distributions, ends) {
  const counts = distributions.map((it) => {
    const bars = new Map(it.bars);
    return ends.map((at) => bars.get(at) || LEAST_COUNT);
  });
  const plot = element("div", { className: "plot" });
  const legend = element("table", { className: "legend" });
  section.append(element("div", { className: "chart" }, plot, legend));
  distributions.forEach((it, k) => {
    const swatch = element("span", { className: "swatch" });
    swatch.style.color = `var(--c${k})`;
    legend.append(element("tr", {}, element("td", {}, swatch, ` ${it.name}`)));
  });
  const [xAxis, yAxis] = axes("cycles");
  const decade = (ticks) => ticks.map((tick) => (Number.isInteger(Math.round(1e6 * Math.log10(tick)) / 1e6) ? tickText(tick) : ""));
  const options = {
    width: plot.clientWidth || 600, height: 230, legend: { show: false },
    axes: [{ ...xAxis, label: "time [µs]", values: (_, ticks) => decade(ticks) }, { ...yAxis, values: (_, ticks) => decade(ticks) }],
    scales: {
      x: { time: false, distr: 3, range: () => [ends[0] / 1.3, ends[ends.length - 1] * 1.3] },
      y: { distr: 3, range: (_, low, high) => [LEAST_COUNT, 1.5 * high] },
    },
    cursor: { show: false },
    series: [{}].concat(distributions.map((it, k) => ({
      label: it.name, width: 2, stroke: () => color(`c${k}`), points: { show: false }, paths: uPlot.paths.stepped({ align: -1 }),
    }))),
  };
  return { chart: new uPlot(options, [ends, ...counts], plot), plot };
}

function percentiles(distributions) {
  const table = element("table", { className: "table" });
  const heads = ["[µs]", "least", "p50", "p90", "p99", "p99.9", "p99.99", "largest", "cycles"];
  table.append(element("tr", {}, ...heads.map((text) => element("th", { textContent: text }))));
  for (const { name, times } of distributions) {
    const keys = ["min", "p50", "p90", "p99", "p999", "p9999", "max"];
    const cells = keys.map((key) => (times[key] / 1000).toFixed(1)).concat(String(times.count));
    table.append(element("tr", {}, ...[name, ...cells].map((text) => element("td", { textContent: text }))));
  }
  return table;
}
