// curve.js -- a curve of positive values over iterations, logarithmic in the value.

const SVG = "http://www.w3.org/2000/svg", POINTS_MAX = 1000; // plenty for 400 pixels

function part(name, attributes, text) {
  const made = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  return made;
}

// points: Map of value by iteration. Returns whether there is anything to see.
export function drawCurve(svg, caption, points) {
  const sorted = [...points].filter(([, value]) => value > 0).sort((a, b) => a[0] - b[0]);
  if (sorted.length < 2) return false;
  const every = Math.ceil(sorted.length / POINTS_MAX);
  const shown = sorted.filter((_, i) => i % every === 0 || i === sorted.length - 1);
  const logs = shown.map(([, value]) => Math.log(value));
  const low = Math.min(...logs), high = Math.max(...logs), last = shown.at(-1)[0] || 1;
  const path = shown.map(([step], i) =>
    `${i ? "L" : "M"}${(45 + 350 * step / last).toFixed(1)} ${(100 - 90 * (logs[i] - low) / (high - low || 1)).toFixed(1)}`);
  svg.replaceChildren(
    part("line", { x1: 45, y1: 100, x2: 395, y2: 100 }), part("line", { x1: 45, y1: 10, x2: 45, y2: 100 }),
    part("path", { d: path.join("") }),
    part("text", { x: 40, y: 14, "text-anchor": "end" }, Math.exp(high).toPrecision(2)),
    part("text", { x: 40, y: 102, "text-anchor": "end" }, Math.exp(low).toPrecision(2)),
    part("text", { x: 45, y: 116 }, "0"),
    part("text", { x: 395, y: 116, "text-anchor": "end" }, `iteration ${last}`));
  caption.textContent = `loss ${sorted.at(-1)[1].toPrecision(3)} at iteration ${sorted.at(-1)[0]}`;
  return true;
}
