// Shows a page in frames of different widths, and leaves an array of what it leaves in each.
const frames = WIDTHS.map((width) => {
  const frame = document.createElement("iframe");
  frame.style.cssText = `width: ${width}px; height: 900px; border: 0`;
  frame.srcdoc = PAGE;
  document.body.append(frame);
  return frame;
});
const timer = setInterval(() => {
  const results = frames.map((frame) => frame.contentDocument.body?.dataset.result);
  if (!results.every(Boolean)) return;
  clearInterval(timer);
  document.body.dataset.result = JSON.stringify(results.map((result) => JSON.parse(result)));
}, 50);
