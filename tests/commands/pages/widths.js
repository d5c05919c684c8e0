// What a page draws or places outside of its room, and the texts at the ticks of its charts.
const texts = [];
const fillText = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
  const box = this.measureText(text);
  const [xs, ys] = [[x - box.actualBoundingBoxLeft, x + box.actualBoundingBoxRight], [y - box.actualBoundingBoxAscent, y + box.actualBoundingBoxDescent]];
  const corners = xs.flatMap((cx) => ys.map((cy) => this.getTransform().transformPoint({ x: cx, y: cy })));
  const [left, right] = [Math.min, Math.max].map((end) => end(...corners.map((it) => it.x)));
  const [top, bottom] = [Math.min, Math.max].map((end) => end(...corners.map((it) => it.y)));
  if (text !== "") texts.push({ canvas: this.canvas, text, left, right, top, bottom });
  fillText.call(this, text, x, y);
};
setTimeout(async () => {
  document.querySelectorAll("details").forEach((it) => { it.open = true; });
  redraw();
  await new Promise((resolve) => setTimeout(resolve, 100));
  // The second drawing is complete; the names of the scene may be anywhere.
  const drawn = texts.filter(({ canvas }) => canvas.isConnected && canvas.id !== "scene");
  const clipped = drawn.filter(({ canvas, left, right, top, bottom }) => left < -1 || top < -1 || right > canvas.width + 1 || bottom > canvas.height + 1);
  const overlap = (a, b) => a.canvas === b.canvas && a.text !== b.text && a.left < b.right && b.left < a.right && a.top < b.bottom && b.top < a.bottom;
  const overlapping = drawn.filter((a, k) => drawn.slice(k + 1).some((b) => overlap(a, b)));
  const room = document.documentElement.clientWidth;
  const outside = [...document.querySelectorAll("body *")].filter((it) => {
    const scroller = it.closest(".wide, .scroll, pre");
    return (!scroller || scroller === it) && it.getBoundingClientRect().right > room + 1;
  });
  document.body.dataset.result = JSON.stringify({
    error: document.body.dataset.error || null, width: innerWidth, texts: drawn.length,
    clipped: clipped.map(({ text }) => text), overlapping: overlapping.map(({ text }) => text),
    outside: outside.map((it) => `${it.tagName} ${it.className} ${it.textContent.slice(0, 40)}`),
    axes: charts.map(({ axis }) => ({ title: axis.title, texts: axis.texts })),
    computed: CASES.map(([label, low, high]) => {
      const { title, texts } = axisOf(label, low, high, 0.05, 5);
      return [title, ...texts];
    }),
  });
}, 300);
