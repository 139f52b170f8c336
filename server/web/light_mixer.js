// light_mixer.js -- the light mixer of a room: a switch, a strength and a colour for each lamp, the sky and the sun over renders
// of each alone, mixed in the browser at once and saved as a render.

import { ask, get } from "./api.js";
import { element, showEach } from "./dom.js";
import { readExr } from "./exr.js";
import { applyFactor, colourOf, meanOf, Mix } from "./light_mix.js";
import { hasOtherFiles, hasOwnCamera, inLane, isBusy, isPerLight, sizeOf, startRender } from "./renders.js";

const SMALL_WIDTH = 320, LARGE_WIDTH = 640; // pixels
const LARGE_SPP = 64, SAVED_SPP = 256;
const ABOUT = { sky: "Sky", sun: "Sun" };

const strength = (row) => 2 ** Number(row.querySelector("input[type=range]").value);
const shown = (factor) => `× ${factor < 10 ? factor.toFixed(2) : factor.toFixed(1)}`;

export class Mixer {
  // server: {me, jobs}; camera(): {frame, look} of the room as it is seen in three dimensions, or null; whenStarted(job)
  constructor(root, server, camera, whenStarted) {
    Object.assign(this, { root, server, camera, whenStarted, frames: [] });
    this.at = (name) => root.querySelector(`.mixer-${name}`);
    this.at("small").addEventListener("click", () => this.make(true));
    this.at("large").addEventListener("click", () => this.make(false));
    this.at("save").addEventListener("click", () => this.save());
    this.at("reset").addEventListener("click", () => this.reset());
    for (const name of ["exposure", "transform"]) this.at(name).addEventListener("input", () => this.draw());
    this.watch = new IntersectionObserver(([entry]) => {
      this.isSeen = entry.isIntersecting;
      if (this.job) this.show(this.job);
    }, { rootMargin: "400px" });
    this.watch.observe(root);
  }

  close() { this.watch.disconnect(); }

  // job: a reconstruction that is done, or a render of each light. Whenever any job changes.
  show(job) {
    this.job = job;
    const isRoom = job.kind === "reconstruct" && job.state === "succeeded", { me, jobs } = this.server;
    const its = isRoom ? [...jobs.values()].filter((other) => other.source === job.id && isPerLight(other)).sort((a, b) => b.id - a.id)
      : isPerLight(job) ? [job] : [];
    const base = its.find((other) => other.state === "succeeded"), busy = its.find(isBusy), newest = its[0];
    this.source = isRoom ? job.id : job.source;
    this.root.hidden = !isRoom && its.length === 0;
    this.at("make").hidden = !isRoom || me.role === "viewer" || Boolean(busy);
    this.at("progress").hidden = !busy;
    if (busy) this.at("progress").value = busy.progress;
    if (busy) this.say(`Each light is rendered alone: job ${busy.id}, ${busy.state}.`);
    else if (isRoom && !newest) this.say("Each light has to be rendered alone once; then they are mixed here at once.");
    else if (newest && newest.state !== "succeeded" && newest.id !== this.told) {
      this.told = newest.id; // once, since what is mixed meanwhile has words of its own
      this.say([`Job ${newest.id} has ${newest.state === "failed" ? "failed" : "been cancelled"}`, newest.reason].filter(Boolean).join(": "));
    }
    this.at("save").hidden = this.at("saves").hidden = me.role === "viewer";
    if (this.root.hidden || !(this.isSeen || this.isAsked)) return; // what is asked for may be out of sight when it is done
    if (isRoom && this.frames.length === 0) this.listViews();
    if (base && base.id !== this.base?.id) this.open(base);
  }

  say(words) {
    if (this.at("state").textContent !== words) this.at("state").textContent = words;
  }

  // --- renders of each light ------------------------------------------------------------------

  async listViews() {
    this.frames = [null]; // it is asked once
    const { frames } = await get(`v1/jobs/${this.source}/outputs/views.json`).catch(() => ({ frames: [] }));
    this.frames = frames;
    const items = [...frames.map((frame, i) => [String(i), `photograph ${frame.file_path}`]), ["room", "as the room is seen above"]];
    showEach(this.at("view"), items, ([value]) => value, () => element("option", null), (option, [value, title]) => {
      option.value = value;
      option.textContent = title;
    });
  }

  async make(isSmall) {
    const { value } = this.at("view"), isOwn = value === "room", seen = isOwn ? this.camera() : null, frame = isOwn ? seen?.frame : this.frames[Number(value)];
    this.isAsked = true;
    this.at("small").disabled = this.at("large").disabled = true;
    try {
      if (!frame) throw new Error(isOwn ? "The room is not shown yet." : "There is no photograph to look from.");
      const size = sizeOf(frame, isSmall ? SMALL_WIDTH : LARGE_WIDTH), own = isOwn ? frame : null;
      const settings = { per_light: true, precision: "half", size, ...(isOwn ? seen.look : { view: value }) };
      const all = isSmall ? await inLane(this.source, settings, own) : { ...settings, spp: LARGE_SPP };
      const started = await startRender(this.source, `${this.job.name}, each light`, all, own);
      this.server.jobs.set(started.id, started);
      this.show(this.job);
    } catch (problem) {
      this.say(problem.message);
    }
    this.at("small").disabled = this.at("large").disabled = false;
  }

  // --- opening --------------------------------------------------------------------------------

  async open(base) {
    this.base = base;
    this.say("The lights are loaded.");
    try {
      const path = `v1/jobs/${base.id}/outputs`;
      const [{ items }, views, report] = await Promise.all([get(path), get(`${path}/views.json`),
        get(`v1/jobs/${base.source}/outputs/report.json`).catch(() => ({}))]);
      const files = views.frames[0].files.filter(({ name, pass }) => name.endsWith(".exr") && /^(light_\d+|lamp_\d+|insert_\d+|sky|sun)$/.test(pass));
      const pictures = await Promise.all(files.map(async ({ name, pass }) => {
        const output = items.find((o) => o.name === name);
        return { name: pass, ...await readExr(await (await ask(output.href.slice(1))).arrayBuffer()) };
      }));
      if (this.base !== base) return; // another was chosen meanwhile
      this.begin(pictures, views, report);
    } catch (problem) {
      this.say(`The lights cannot be mixed: ${problem.message}.`);
    }
  }

  begin(pictures, views, report) {
    if (pictures.length === 0) {
      this.say("Nothing shines in this room.");
      return;
    }
    const { width, height } = pictures[0], brightness = new Map(pictures.map((p) => [p, meanOf(p.rgb)]));
    pictures.sort((a, b) => brightness.get(b) - brightness.get(a));
    this.views = views;
    this.mix = new Mix(width, height, pictures);
    Object.assign(this.at("canvas"), { width, height });
    this.pixels = this.at("canvas").getContext("2d").createImageData(width, height);
    const segment = (number) => report.segments?.find((s) => s.segment === number);
    this.titles = pictures.map(({ name }) => {
      const [kind, number] = name.split("_");
      return ABOUT[kind] ?? (kind === "light" ? segment(Number(number))?.name ?? `Lamp ${number}` : `${kind} ${number}`);
    });
    this.at("transform").value = views.settings.view_transform ?? "srgb";
    showEach(this.at("lights"), pictures, ({ name }) => name, () => this.makeLight(), (row, picture) => {
      const title = this.titles[pictures.indexOf(picture)];
      row.querySelector("legend").textContent = title;
      row.querySelector("input[type=range]").ariaLabel = `strength of ${title}`;
      row.querySelector("input[type=color]").ariaLabel = `colour of ${title}`;
    });
    this.at("desk").hidden = false;
    this.reset();
    this.say(`${pictures.length} light${pictures.length > 1 ? "s" : ""}, the brightest first; ${width} × ${height} pixels of job ${this.base.id}.`);
  }

  makeLight() {
    const row = element("fieldset", null), label = element("label", null);
    label.append(element("input", null, { type: "checkbox", checked: true }), " on");
    row.append(element("legend", null), label, element("input", null, { type: "range", min: -5, max: 5, step: 0.1, value: 0 }),
      element("output", null), element("input", null, { type: "color", value: "#ffffff" }));
    row.addEventListener("input", () => this.draw());
    return row;
  }

  reset() {
    for (const row of this.at("lights").children) {
      row.querySelector("input[type=checkbox]").checked = true;
      row.querySelector("input[type=range]").value = 0;
      row.querySelector("input[type=color]").value = "#ffffff";
    }
    this.at("exposure").value = 0;
    this.draw();
  }

  // --- mixing ---------------------------------------------------------------------------------

  factors() {
    return [...this.at("lights").children].map((row) => {
      const isOn = row.querySelector("input[type=checkbox]").checked, by = strength(row);
      return isOn ? colourOf(row.querySelector("input[type=color]").value).map((x) => by * x) : [0, 0, 0];
    });
  }

  exposure() { return this.views.exposure * 2 ** Number(this.at("exposure").value); }

  draw() {
    if (!this.mix) return;
    const began = performance.now(), factors = this.factors(), canvas = this.at("canvas");
    this.mix.show(factors, this.exposure(), this.at("transform").value, this.pixels.data);
    canvas.getContext("2d").putImageData(this.pixels, 0, 0);
    canvas.dataset.ms = (performance.now() - began).toFixed(1); // what tests print
    for (const row of this.at("lights").children) {
      const words = shown(strength(row)), range = row.querySelector("input[type=range]");
      row.querySelector("output").textContent = words;
      range.ariaValueText = words;
    }
    const lit = this.titles.filter((_, i) => factors[i].some((x) => x > 0));
    canvas.ariaLabel = `the room lit by ${lit.join(", ") || "nothing"}`;
    this.at("exposure-words").textContent = `${Number(this.at("exposure").value).toFixed(1)} stops`;
    this.at("save").disabled = lit.length === 0;
  }

  // --- saving ---------------------------------------------------------------------------------

  // The settings of the base with the lights as they are mixed now.
  settings() {
    const { per_light, precision, format, spp, ...settings } = this.base.settings;
    this.factors().forEach((factor, i) => applyFactor(settings, this.mix.sources[i].name, factor));
    return { ...settings, spp: SAVED_SPP, exposure: Number(this.exposure().toPrecision(6)), view_transform: this.at("transform").value };
  }

  async save() {
    this.at("save").disabled = true;
    try {
      if (hasOtherFiles(this.base)) throw new Error("This render has files of its own, which the page does not have: `unbake render` takes them again.");
      const { files, picture, spp, noise, denoised, sun, ...frame } = this.views.frames[0];
      const job = await startRender(this.base.source, `${this.job.name}, mixed`, this.settings(), hasOwnCamera(this.base) ? frame : null);
      this.server.jobs.set(job.id, job);
      this.whenStarted(job);
    } catch (problem) {
      this.say(problem.message);
    }
    this.at("save").disabled = false;
  }
}
