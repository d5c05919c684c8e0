// Uses a page as a person does, and leaves what it has found in an attribute of the body.
setTimeout(async () => {
  const rest = () => new Promise((resolve) => setTimeout(resolve, 50));
  const slider = document.getElementById("time");
  const picture = () => scene.toDataURL();
  const move = async (t) => {
    slider.value = t;
    slider.dispatchEvent(new Event("input"));
    await rest();
    return picture();
  };
  // Curves are coloured; grid, axes and references are not.
  const isDrawn = ({ chart }) => {
    const { left, top, width, height } = chart.bbox;
    const pixels = chart.ctx.getImageData(left, top, width, height).data;
    for (let k = 0; k < pixels.length; k += 4) {
      const rgb = pixels.slice(k, k + 3);
      if (pixels[k + 3] > 200 && Math.max(...rgb) - Math.min(...rgb) > 60) return true;
    }
    return false;
  };
  const found = { error: document.body.dataset.error || null, charts: charts.length, drawn: charts.filter(isDrawn).length };
  found.distribution = distributionChart !== null;
  const value = (t, name) => sampleAt(t)(HEAD.columns[name]);
  found.at = INSTANTS.map((t) => [value(t, "position"), value(t, "length"), value(t, "force")]);
  found.largest = Math.max(...charts.find(({ series }) => series[0].column === HEAD.columns.force).chart.data[1]);
  const [a, b] = [await move(900), await move(1801.3)];
  found.moves = a !== b && (await move(900)) === a;
  found.cursors = new Set(charts.map(({ chart }) => Math.round(100 * chart.cursor.left / chart.bbox.width * uPlot.pxRatio))).size;
  const over = charts[3].chart.over;
  const box = over.getBoundingClientRect();
  over.dispatchEvent(new MouseEvent("mousemove", { clientX: box.left + box.width / 2, clientY: box.top + 5, bubbles: true }));
  await rest();
  found.pointer = Number(slider.value);
  const turned = picture();
  scene.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowLeft" }));
  found.turns = picture() !== turned;
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "w", bubbles: true }));
  await rest();
  found.zoomed = range.to - range.from;
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "0", bubbles: true }));
  await rest();
  found.whole = range.to - range.from;
  setRange(FAULT_S - 0.4, FAULT_S + 0.4);
  await rest();
  const times = charts[0].chart.data[0];
  found.step = (times[times.length - 1] - times[0]) / (times.length - 1);
  setTime(FAULT_S);
  found.text = document.getElementById("interval").textContent;
  found.focus = [slider, scene, document.getElementById("play")].every((it) => it.tabIndex === 0);
  found.facts = [...document.querySelectorAll("#facts dd")].map((it) => it.textContent);
  document.body.dataset.result = JSON.stringify(found);
}, 300);
