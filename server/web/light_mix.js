// light_mix.js -- light adds up: a picture under any strength and colour of its sources is the sum of its pictures under each of
// them alone. Shown as the server shows it (server/relight/passes.c, common/png_write.c).

const STEPS = 65536;
const MOST = { srgb: 1, filmic: 8 }; // display light is 1 from here on: the filmic curve reaches it at 7.24

const filmic = (x) => Math.min(1, x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14)); // Narkowicz 2015
const encoded = (x) => (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055);          // IEC 61966-2-1

// Code value by scene light times exposure, from 0 to MOST.
function codes(transform) {
  const table = new Uint8ClampedArray(STEPS), step = MOST[transform] / (STEPS - 1);
  for (let i = 0; i < STEPS; i++)
    table[i] = Math.floor(255 * encoded(transform === "filmic" ? filmic(i * step) : i * step) + 0.5);
  return table;
}

const tables = {};

export class Mix {
  // sources: [{rgb}] of width x height pixels
  constructor(width, height, sources) {
    Object.assign(this, { width, height, sources, sum: new Float32Array(3 * width * height) });
  }

  // factors: [r, g, b] for each source
  add(factors) {
    const { sum, sources } = this;
    sum.fill(0);
    sources.forEach(({ rgb }, s) => {
      const [r, g, b] = factors[s];
      if (r === 0 && g === 0 && b === 0) return;
      for (let i = 0; i < sum.length; i += 3) {
        sum[i] += r * rgb[i];
        sum[i + 1] += g * rgb[i + 1];
        sum[i + 2] += b * rgb[i + 2];
      }
    });
  }

  // Fills pixels, [width x height][4] code values. transform: "srgb" or "filmic"
  show(factors, exposure, transform, pixels) {
    this.add(factors);
    const table = tables[transform] ??= codes(transform), scale = exposure * (STEPS - 1) / MOST[transform], { sum } = this;
    for (let i = 0, to = 0; i < sum.length; i += 3, to += 4)
      for (let c = 0; c < 3; c++) {
        const at = sum[i + c] * scale + 0.5;
        pixels[to + c] = table[at < STEPS ? (at > 0 ? at | 0 : 0) : STEPS - 1];
      }
    for (let to = 3; to < pixels.length; to += 4) pixels[to] = 255;
  }
}

// How bright the picture of a source is: its mean.
export const meanOf = (rgb) => rgb.reduce((sum, value) => sum + value, 0) / rgb.length;

// Linear light of "#rrggbb".
export const colourOf = (hex) => [1, 3, 5].map((i) => {
  const x = parseInt(hex.slice(i, i + 2), 16) / 255;
  return x <= 0.04045 ? x / 12.92 : ((x + 0.055) / 1.055) ** 2.4;
});

// --- the settings of a render -----------------------------------------------------------------

// What a setting such as light.27 says: on, off, a factor, or three of them.
export function factorOf(value) {
  if (value === undefined || value === "on") return [1, 1, 1];
  if (value === "off") return [0, 0, 0];
  const numbers = Array.isArray(value) ? value : String(value).split(/[ ,]+/).map(Number);
  return numbers.length === 1 ? [numbers[0], numbers[0], numbers[0]] : numbers;
}

const times = (a, b) => a.map((x, c) => x * b[c]);
const written = (factor) => factor.map((x) => Number(x.toPrecision(6))).join(",");
const luminance = ([r, g, b]) => 0.2126 * r + 0.7152 * g + 0.0722 * b;

// Changes `settings` so that the source of this name ("light_27", "sky", "sun", "lamp_1", "insert_1") shines by `factor`.
export function applyFactor(settings, name, factor) {
  if (factor.every((x) => x === 1)) return;
  const [kind, number] = name.split("_");
  if (kind === "lamp") {
    const key = `lamp.${number}.radiance`, before = factorOf(settings[key] ?? "10,10,10"), after = times(before, factor);
    const lumen = `lamp.${number}.lumen`;
    if (settings[lumen]) settings[lumen] *= luminance(after) / luminance(before);
    settings[key] = written(after);
  } else if (kind === "insert") {
    const key = `insert.${number}.emission`;
    settings[key] = written(times(factorOf(settings[key]), factor));
  } else {
    const key = number === undefined ? kind : `${kind}.${number}`, after = times(factorOf(settings[key]), factor);
    settings[key] = after.every((x) => x === 0) ? "off" : written(after);
  }
}
