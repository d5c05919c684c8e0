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
