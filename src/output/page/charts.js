// Charts over time. All share the range of time and the instant of the cursor.

const Y_AXIS_PX = 84;
const RIGHT_PX = 22;
const PLOT_HEIGHT_PX = 152;
// Height of each of the plots of a panel whose components have axes of their own.
const SMALL_PLOT_PX = 84;
// Number of ticks of an axis of values at most; there are two at least.
const VALUE_TICKS = 5;
// Below the plot: numbers, and the label of the time.
const NUMBERS_PX = 28;
const LABEL_PX = 18;
const panels = [];
// The charts of all panels.
let charts = [];

const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}

function axes(xAxis, yAxis) {
  const font = "12px system-ui, sans-serif";
  const common = {
    stroke: () => color("ink"), font, labelFont: font, labelSize: LABEL_PX, labelGap: 0,
    grid: { stroke: () => color("grid"), width: 1 }, ticks: { stroke: () => color("grid"), width: 1, size: 5 },
  };
  return [{ ...common, size: NUMBERS_PX, ...xAxis }, { ...common, size: Y_AXIS_PX, ...yAxis }];
}

// Style of a line on top of others.
const DASHED = { width: 1, dash: [4, 4], stroke: () => color("ink"), alpha: 0.8 };

// Series of a panel: first what was measured or applied, then the references on top of them.
function seriesOf(panel) {
  const first = HEAD.columns[panel.signal] + (panel.first || 0);
  const measured = panel.names.map((name, k) => ({
    column: first + k, color: k + (panel.color || 0), label: name, width: 2, stroke: () => color(`c${k + (panel.color || 0)}`),
    ...(k === panel.dashed ? DASHED : {}),
  }));
  if (!panel.reference) return measured;
  const reference = HEAD.columns[panel.reference] + (panel.first || 0);
  return measured.concat(panel.names.map((name, k) => ({ column: reference + k, label: `${name}, reference`, ...DASHED })));
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
    const swatch = element("span", { className: k === panel.dashed ? "swatch dashed" : "swatch" });
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
  // In the unit of the axis.
  const show = (sample, exponent) => rows.forEach((cells, k) => cells.forEach((cell, which) => {
    const number = sample(series[k + which * panel.names.length].column) / 10 ** exponent;
    cell.textContent = rounded(number, Math.max(0, (panel.digits || 0) + exponent));
  }));
  return { table, show };
}

// Range of a component and of its reference over all samples.
function componentRange(panel, k) {
  let [low, high] = [Infinity, -Infinity];
  for (const signal of [panel.signal, panel.reference].filter(Boolean)) {
    for (const { columns, samples } of levels) {
      const column = columns[HEAD.columns[signal] + k];
      for (let at = 0; at < samples; at++) {
        if (column[at] < low) low = column[at];
        if (column[at] > high) high = column[at];
      }
    }
  }
  return [low, high];
}

// Gives components axes of their own where a common one would hide one of them. They keep them: charts that join again and again
// cannot be read.
function separateComponents() {
  for (const shown of panels.filter(({ panel, isSeparate }) => !isSeparate && !panel.isCompared)) {
    shown.isSeparate = needOwnAxes(shown.panel.names.map((_, k) => componentRange(shown.panel, k)));
    if (shown.isSeparate) layOut(shown);
  }
  charts = panels.flatMap((shown) => shown.charts);
}

// Draws the charts of a panel: one, or one for each component.
function layOut(shown) {
  const { panel, box, isSeparate } = shown;
  shown.charts.forEach(({ chart }) => chart.destroy());
  box.replaceChildren();
  const unit = panel.label.slice(panel.label.indexOf("["));
  const components = panel.names.map((name, k) => ({
    ...panel, label: `${name} ${unit}`, names: [name], first: k, color: k + (panel.color || 0), height: SMALL_PLOT_PX,
  }));
  const parts = isSeparate ? components : [{ ...panel, height: PLOT_HEIGHT_PX }];
  shown.charts = parts.map((part, k) => addChart(box, part, k + 1 === parts.length));
}

function addChart(section, panel, isLowest) {
  const series = seriesOf(panel);
  const caption = element("div", { className: "caption" });
  const plot = element("div", { className: "plot" }, caption);
  const box = element("div", { className: "chart" }, plot);
  section.append(box);
  const made = { plot, series, axis: axisOf(panel.label, 0, 1, 0, 2) };
  const timeAxis = (chart) => axisOf("time [s]", range.from, range.to, 0, Math.max(2, chart.bbox.width / uPlot.pxRatio / 70));
  const valueAxis = (_, low, high) => {
    made.axis = axisOf(panel.label, low ?? 0, high ?? 1, 0.05, VALUE_TICKS);
    caption.textContent = made.axis.title;
    return [made.axis.low, made.axis.high];
  };
  const xAxis = {
    label: isLowest ? (chart) => timeAxis(chart).title : null,
    splits: (chart) => timeAxis(chart).ticks, values: (chart) => timeAxis(chart).texts,
  };
  const options = {
    width: plot.clientWidth || 600, height: panel.height + 8 + NUMBERS_PX + (isLowest ? LABEL_PX : 0), legend: { show: false },
    axes: axes(xAxis, { splits: () => made.axis.ticks, values: () => made.axis.texts }),
    scales: { x: { time: false, range: () => [range.from, range.to] }, y: { range: valueAxis } },
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
  return Object.assign(made, { chart, legend });
}

function addFigures() {
  const figures = document.getElementById("figures");
  for (const figure of FIGURES) {
    const section = element("section", {}, element("h2", { textContent: figure.title }));
    figures.append(section);
    for (const panel of figure.panels) {
      const box = element("div");
      section.append(box);
      panels.push({ panel, box, charts: [], isSeparate: false });
    }
  }
  panels.forEach(layOut);
  separateComponents();
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
  for (const { chart, legend, axis } of charts) {
    legend.show(sample, axis.exponent);
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
  section.querySelectorAll(".chart, .wide").forEach((old) => old.remove());
  if (distributionChart) distributionChart.chart.destroy();
  distributionChart = null;
  const ends = [...new Set(distributions.flatMap((it) => it.bars.map(([at]) => at)))].sort((a, b) => a - b);
  if (ends.length > 0) distributionChart = distributionOf(section, distributions, ends);
  section.append(element("div", { className: "wide" }, percentiles(distributions)));
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
  const decades = (text) => (_, ticks) => ticks.map((tick) => (Number.isInteger(Math.round(1e6 * Math.log10(tick)) / 1e6) ? text(tick) : ""));
  const count = (tick) => (tick < 1e4 ? String(Math.round(tick)) : powerOfTen(Math.round(Math.log10(tick))));
  const options = {
    width: plot.clientWidth || 600, height: 230, legend: { show: false },
    axes: axes(
      { label: "time", values: decades((tick) => quantityText(1e-6 * tick, "s")) },
      { label: "cycles", size: Y_AXIS_PX - LABEL_PX, values: decades(count) },
    ),
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
