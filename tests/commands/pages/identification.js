// What the page of an identification shows, and the RMS of the residuals that its charts draw.
setTimeout(() => {
  const rows = (id) => [...document.querySelectorAll(`#${id} tr`)].map((row) => [...row.cells].map((cell) => cell.textContent));
  const rms = (name) => LEGS.map((_, leg) => {
    const drawn = levels.flatMap((level) => [...level.columns[HEAD.columns[name] + leg]]).filter(Number.isFinite);
    return Math.sqrt(drawn.reduce((sum, number) => sum + number * number, 0) / drawn.length);
  });
  // Largest difference between a residual and the recorded less the predicted force.
  const differences = levels.flatMap(({ columns }) => LEGS.flatMap((_, leg) => ["residual_before", "residual_after"].flatMap((name, k) => {
    const [recorded, predicted] = [0, k + 1].map((which) => columns[HEAD.columns[`leg_${leg + 1}`] + which]);
    return [...columns[HEAD.columns[name] + leg]].map((residual, at) => Math.abs(recorded[at] - predicted[at] - residual));
  })));
  const marks = [...document.querySelectorAll("#parameters .bar b")].map((mark) => {
    const [point, bar] = [mark, mark.parentElement].map((it) => it.getBoundingClientRect());
    return (point.left + point.width / 2 - bar.left) / (bar.width / 2) - 1;
  });
  document.body.dataset.result = JSON.stringify({
    error: document.body.dataset.error || null, drawn: charts.map(isDrawn), rms: [rms("residual_before"), rms("residual_after")],
    difference: Math.max(...differences.filter(Number.isFinite)), parameters: rows("parameters"), residuals: rows("residuals"),
    hollow: document.querySelectorAll("#parameters .hollow").length, marks,
  });
}, 300);
