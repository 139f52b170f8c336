// pictures.js -- pictures of a job: held-out photographs and their re-renders under one slider, and thumbnails that open
// large.

import { $, element, showEach } from "./dom.js";
import { load } from "./api.js";

// --- photograph and re-render -----------------------------------------------------------------

const GAP = 4;      // pixels between the pictures
const SHARP = 1000; // pixels that the canvas has across at least

// compare/NNN.png is photograph | re-render | difference, side by side (server/export/pictures.c).
export class Slider {
  constructor(figure) {
    this.figure = figure;
    this.image = new Image();
    this.canvas = figure.querySelector("canvas");
    this.range = figure.querySelector("input[type=range]");
    this.view = figure.querySelector("select");
    this.difference = figure.querySelector("input[type=checkbox]");
    this.range.addEventListener("input", () => this.draw());
    this.difference.addEventListener("change", () => this.draw());
    this.view.addEventListener("change", () => this.open());
    const drag = (event) => {
      if (event.buttons !== 1) return;
      const box = this.canvas.getBoundingClientRect(), { width, height } = this.canvas;
      const shown = Math.min(box.width, box.height * width / height); // beside it there may be margins
      this.range.value = 50 + 100 * (event.clientX - box.left - box.width / 2) / shown;
      this.draw();
    };
    this.canvas.addEventListener("pointerdown", drag);
    this.canvas.addEventListener("pointermove", drag);
  }

  // outputs: those of the job that are comparisons; names: of the photographs, in their order, where known.
  show(outputs, names = []) {
    this.figure.hidden = outputs.length === 0;
    this.outputs = outputs;
    showEach(this.view, outputs, (o) => o.name, () => element("option", null), (option, o) => {
      const i = outputs.indexOf(o);
      option.value = o.name;
      option.textContent = names[i] ?? `view ${i + 1}`;
    });
    if (outputs.length > 0) this.open();
  }

  async open() {
    const output = this.outputs.find((o) => o.name === this.view.value) ?? this.outputs[0];
    const version = output.name + output.sha256;
    if (this.version === version) return;
    this.version = version;
    await load(this.image, output.href.slice(1));
    this.draw();
  }

  draw() {
    const width = Math.floor((this.image.naturalWidth - 2 * GAP) / 3), height = this.image.naturalHeight;
    if (!width) return;
    const scale = Math.max(1, Math.ceil(SHARP / width)); // the line between them is thin in small pictures, too
    Object.assign(this.canvas, { width: scale * width, height: scale * height });
    const paint = this.canvas.getContext("2d"), cut = Math.round(width * this.range.value / 100);
    const panel = (at, from, to) => {
      if (to > from)
        paint.drawImage(this.image, at * (width + GAP) + from, 0, to - from, height, scale * from, 0, scale * (to - from), scale * height);
    };
    panel(0, 0, cut);
    panel(this.difference.checked ? 2 : 1, cut, width);
    paint.fillStyle = "#fff";
    paint.fillRect(scale * cut - 1, 0, 2, scale * height);
    this.canvas.ariaLabel = `${Math.round(100 - this.range.value)} % ${this.difference.checked ? "difference" : "re-render"}, ` +
      "the rest the photograph";
  }
}

// --- thumbnails -------------------------------------------------------------------------------

const ABOUT = {
  "preview/radiance.png": "Measured light", "preview/base_color.png": "Base colour", "preview/roughness.png": "Roughness",
  "preview/specular.png": "Specular", "preview/emission.png": "Emission", "preview/confidence.png": "Confidence",
  "preview/environment.png": "Distant light", "preview/render.png": "So far",
};

// 00003_base_color.png is a pass of a render's fourth picture.
function titleOf(name) {
  const [, picture, pass] = /^(\d{5})_(\w+)\.png$/.exec(name) ?? [];
  return ABOUT[name] ?? (pass ? `Picture ${Number(picture) + 1}, ${pass.replaceAll("_", " ")}` : name);
}

function makeThumbnail(output) {
  const figure = element("figure", null), button = element("button", null, { type: "button" });
  const title = titleOf(output.name);
  button.append(element("img", null, { alt: `${title}, open large` }));
  button.addEventListener("click", () => openLarge(figure.parentElement, figure));
  figure.append(button, element("figcaption", title));
  return figure;
}

function fillThumbnail(figure, output) {
  if (figure.dataset.sha256 === output.sha256) return;
  figure.dataset.sha256 = output.sha256;
  load(figure.querySelector("img"), output.href.slice(1));
}

export function showThumbnails(parent, outputs) {
  showEach(parent, outputs, (output) => output.name, makeThumbnail, fillThumbnail);
}

// --- large ------------------------------------------------------------------------------------

let shown = null; // {parent, figure}

// A figure of `parent`, in the dialog; the arrow keys go to the others.
export function openLarge(parent, figure) {
  shown = { parent, figure };
  const image = figure.querySelector("img");
  $("large-image").src = image.src;
  $("large-image").alt = image.alt.replace(/, open large$/, "");
  $("large-caption").textContent = figure.querySelector("figcaption").textContent;
  $("large-next").hidden = $("large-before").hidden = parent.children.length < 2;
  if (!$("large").open) $("large").showModal();
}

function step(by) {
  const all = [...shown.parent.children].filter((figure) => figure.querySelector("img")?.src);
  openLarge(shown.parent, all[(all.indexOf(shown.figure) + by + all.length) % all.length]);
}

$("large-next").addEventListener("click", () => step(1));
$("large-before").addEventListener("click", () => step(-1));
$("large-close").addEventListener("click", () => $("large").close());
$("large").addEventListener("keydown", (event) => {
  if (event.key === "ArrowRight") step(1);
  if (event.key === "ArrowLeft") step(-1);
});
$("large-image").addEventListener("click", () => $("large").close());
