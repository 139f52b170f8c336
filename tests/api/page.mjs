// page.mjs -- what people do with the web page: lights are mixed and saved, the room is rendered from where it is looked at.
//
// node page.mjs NODE_MODULES CHROMIUM URL PICTURES ROOM: ROOM is a folder that can be sent; job 1 is a room with lamps; a line for each fault
import { readdirSync, readFileSync } from "node:fs";
import { launch, lookAll, modules as loaded } from "./browser.mjs";

const [modules, chromium, url, pictures, room] = process.argv.slice(2);
const { puppeteer, axe } = loaded(modules), browser = await launch(puppeteer, chromium);
let faults = 0;

function check(isRight, words) {
  if (isRight) return;
  faults++;
  console.log(`fault: ${words}`);
}

// {name: its bytes as base64, or such an object}
const readFolder = (path) => Object.fromEntries(readdirSync(path, { withFileTypes: true }).map((entry) => [entry.name,
  entry.isDirectory() ? readFolder(`${path}/${entry.name}`) : readFileSync(`${path}/${entry.name}`).toString("base64")]));

const get = async (path) => (await fetch(`${url}/v1/${path}`)).json();

async function settled(id) {
  for (;;) {
    const job = await get(`jobs/${id}`);
    if (["succeeded", "failed", "cancelled"].includes(job.state)) return job;
    await new Promise((done) => setTimeout(done, 100));
  }
}

async function open(hash, viewport = { width: 1200, height: 900 }) {
  const page = await browser.newPage();
  page.on("pageerror", (error) => check(false, `a script fails: ${error.message}`));
  await page.setViewport(viewport);
  await page.goto(`${url}/${hash}`);
  return page;
}

// --- the light mixer --------------------------------------------------------------------------

// In the page: the mean of the render of all lights, and of what the mixer shows, linear and as code values.
const compare = (id) => (async () => {
  const { readExr } = await import("/web/exr.js"), { Mix } = await import("/web/light_mix.js");
  const read = async (name) => readExr(await (await fetch(`/v1/jobs/${id}/outputs/${name}`)).arrayBuffer());
  const mean = (list) => list.reduce((sum, x) => sum + x, 0) / list.length;
  const views = await (await fetch(`/v1/jobs/${id}/outputs/views.json`)).json(), { files, noise } = views.frames[0];
  const whole = await read("00000_radiance.exr"), alone = files.filter(({ pass }) => pass !== "radiance");
  const sources = await Promise.all(alone.map(({ name }) => read(name))), mix = new Mix(whole.width, whole.height, sources);
  mix.add(sources.map(() => [1, 1, 1]));
  const picture = await createImageBitmap(await (await fetch(`/v1/jobs/${id}/outputs/00000_radiance.png`)).blob());
  const canvas = new OffscreenCanvas(whole.width, whole.height), paint = canvas.getContext("2d");
  paint.drawImage(picture, 0, 0);
  const wanted = paint.getImageData(0, 0, whole.width, whole.height).data, shown = new Uint8ClampedArray(wanted.length);
  new Mix(whole.width, whole.height, [whole]).show([[1, 1, 1]], views.exposure, views.settings.view_transform ?? "srgb", shown);
  return { noise, lights: alone.map(({ pass }) => pass), whole: mean(whole.rgb), sum: mean(mix.sum),
    codes: shown.reduce((most, x, i) => Math.max(most, Math.abs(x - wanted[i])), 0) };
})();

// All lights at 1 are the render of all lights within its noise, and are shown as the server shows it.
async function compareSum(page) {
  for (const transform of ["srgb", "filmic"]) {
    const settings = { per_light: true, format: "both", precision: "half", size: "64x48", spp: 64, view_transform: transform };
    const { id } = await (await fetch(`${url}/v1/jobs`, { method: "POST", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ kind: "render", source: 1, settings }) })).json();
    const job = await settled(id);
    check(job.state === "succeeded", `the render of each light: ${job.reason}`);
    const { noise, lights, whole, sum, codes } = await page.evaluate(compare, id);
    // The noise is a pixel's; the mean of all has less, and so have the lights that are alone. Half has 11 bits.
    check(Math.abs(sum / whole - 1) < noise, `${lights}: their sum is ${sum}, not ${whole}`);
    check(codes <= 1, `${transform}: code values differ by ${codes}`);
  }
}

// The settings that lights mean.
const applied = (before, name, factor) => (async () => {
  const { applyFactor } = await import("/web/light_mix.js"), settings = structuredClone(before);
  applyFactor(settings, name, factor);
  return settings;
})();
async function saveSettings(page) {
  const cases = [
    [{}, "light_27", [1, 1, 1], {}],
    [{}, "light_27", [0, 0, 0], { "light.27": "off" }],
    [{ "light.27": "2" }, "light_27", [0.5, 1, 0], { "light.27": "1,2,0" }],
    [{ sky: "off" }, "sky", [2, 2, 2], { sky: "off" }],
    [{}, "sun", [2, 0.25, 1], { sun: "2,0.25,1" }],
    [{ "lamp.1.kind": "sphere" }, "lamp_1", [0.5, 0.5, 0.5], { "lamp.1.kind": "sphere", "lamp.1.radiance": "5,5,5" }],
    [{ "lamp.1.radiance": "1,1,1", "lamp.1.lumen": 800 }, "lamp_1", [0.5, 0.5, 0.5], { "lamp.1.radiance": "0.5,0.5,0.5", "lamp.1.lumen": 400 }],
    [{ "insert.2.emission": [1, 2, 3] }, "insert_2", [2, 2, 2], { "insert.2.emission": "2,4,6" }],
  ];
  for (const [before, name, factor, wanted] of cases) {
    const found = await page.evaluate(applied, before, name, factor);
    check(JSON.stringify(found) === JSON.stringify(wanted), `${name} by ${factor}: ${JSON.stringify(found)}`);
  }
}

// Eight lights at 640 x 480; a figure to read, since no clock of a shared machine decides a test.
async function timeMix(page) {
  const times = await page.evaluate(async () => {
    const { Mix } = await import("/web/light_mix.js"), count = 3 * 640 * 480, pixels = new Uint8ClampedArray(4 * 640 * 480), times = [];
    const mix = new Mix(640, 480, [...Array(8)].map((_, s) => ({ rgb: Float32Array.from({ length: count }, (_, i) => ((i * (s + 7)) % 101) / 200) })));
    for (let i = 0; i < 9; i++) {
      const began = performance.now();
      mix.show(mix.sources.map(() => [1, 0.5, 0.1 * i]), 0.7, "filmic", pixels);
      times.push(performance.now() - began);
    }
    return times.sort((a, b) => a - b);
  });
  console.log(`8 lights at 640 x 480 are mixed in ${times[4].toFixed(1)} ms (${times[0].toFixed(1)} to ${times[8].toFixed(1)})`);
}

const set = (page, selector, value, row = 0) => page.evaluate((selector, value, row) => {
  const input = document.querySelectorAll(selector)[row];
  if (input.type === "checkbox") input.checked = value;
  else input.value = value;
  input.dispatchEvent(new Event("input", { bubbles: true }));
}, selector, value, row);
const meanShown = (page) => page.$eval("#job .mixer-canvas", (canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return [0, 1, 2].map((c) => data.reduce((sum, x, i) => sum + (i % 4 === c ? x : 0), 0) / (data.length / 4));
});

async function openMixer() {
  const page = await open("#job=1");
  await page.waitForSelector("#job .mixer:not([hidden])");
  await page.$eval("#job .mixer", (mixer) => mixer.scrollIntoView());
  return page;
}

// Lights are loaded once the mixer is in sight, and what comes to stand above it may move it out of that.
async function untilMixed(page) {
  await page.waitForFunction(() => {
    document.querySelector("#job .mixer").scrollIntoView();
    return !document.querySelector("#job .mixer-desk").hidden;
  }, { timeout: 90000, polling: 200 });
}

// Where no light was rendered alone, the page offers it, shows how it goes on, and opens the mixer when it is done.
async function makeLights() {
  const page = await openMixer();
  await page.waitForSelector("#job .mixer-view option");
  await page.$eval("#job .mixer-small", (button) => button.click());
  await page.waitForSelector("#job .mixer-progress:not([hidden])");
  check(await page.$eval("#job .mixer-make", (make) => make.hidden), "what is being made is offered");
  await page.waitForSelector("#job .mixer-desk:not([hidden])", { timeout: 90000 });
  await page.close();
}

// Lights are mixed, and the render that is saved shows what the mixer shows.
async function mixLights() {
  const page = await openMixer();
  await untilMixed(page);
  const lights = await page.$$eval("#job .mixer-lights fieldset", (rows) => rows.map((row) => row.querySelector("legend").textContent));
  check(lights.length >= 3, `lights: ${lights}`);
  const before = await meanShown(page);
  await set(page, "#job .mixer-lights input[type=checkbox]", false, 0);
  await set(page, "#job .mixer-lights input[type=range]", 1, 1);
  await set(page, "#job .mixer-lights input[type=color]", "#ff8000", 2);
  await set(page, "#job .mixer-exposure", 0.5);
  const mixed = await meanShown(page), size = await page.$eval("#job .mixer-canvas", (canvas) => `${canvas.width} x ${canvas.height}`);
  check(Math.abs(mixed[0] - before[0]) > 2, `the mixture is ${mixed}, as before`);
  console.log(`mixed ${lights.length} lights at ${size} in ${await page.$eval("#job .mixer-canvas", (canvas) => canvas.dataset.ms)} ms`);
  faults += await lookAll(page, axe, pictures, "mixer");
  await page.$eval("#job .mixer-save", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#job .name").textContent.endsWith(", mixed"));
  const id = Number(new URLSearchParams((await page.evaluate(() => location.hash)).slice(1)).get("job")), job = await settled(id);
  check(job.state === "succeeded", `the mixture's render: ${job.reason}`);
  check(Object.entries(job.settings).filter(([name]) => name.startsWith("light.")).length === 3 && job.settings.per_light === undefined,
    `the mixture's settings: ${JSON.stringify(job.settings)}`);
  const rendered = await page.evaluate(async (id) => {
    const bitmap = await createImageBitmap(await (await fetch(`/v1/jobs/${id}/outputs/00000_radiance.png`)).blob());
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height), paint = canvas.getContext("2d");
    paint.drawImage(bitmap, 0, 0);
    const { data } = paint.getImageData(0, 0, bitmap.width, bitmap.height);
    return [0, 1, 2].map((c) => data.reduce((sum, x, i) => sum + (i % 4 === c ? x : 0), 0) / (data.length / 4));
  }, id);
  // Code values; noise moves their mean a little, since the encoding is no straight line.
  check(rendered.every((x, c) => Math.abs(x - mixed[c]) < 3), `saved it is ${rendered}, mixed ${mixed}`);
  await page.close();
}

// Renders of each light that fail say why, also where older ones are mixed, which they stay.
async function failLights() {
  const page = await openMixer();
  await untilMixed(page);
  await fetch(`${url}/v1/jobs`, { method: "POST", headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ kind: "render", source: 1, settings: { per_light: true, lights: "off", size: "8x8", spp: 4 } }) });
  await page.waitForFunction(() => document.querySelector("#job .mixer-state").textContent.includes("Nothing shines"), { timeout: 30000 })
    .catch(() => check(false, "a failed render of each light is not told"));
  check(await page.$$eval("#job .mixer-lights fieldset", (rows) => rows.length) >= 3, "the lights are gone");
  await page.close();
}

// --- words ------------------------------------------------------------------------------------

// Nothing is called far from the photograph where it is the noise of the re-render that is far.
async function judge(page) {
  const cases = [
    [{}, []],
    [{ psnr_db: 18, msre: 0.3, msre_noise_left: 0.01, msre_render_noise: 0.2 }, ["18.0 dB, far from the photograph"]],
    [{ psnr_db: 18, msre: 0.3, msre_noise_left: 0.2, msre_render_noise: 0.2 }, ["18.0 dB, far from the photograph, as far as noise lets tell"]],
    [{ psnr_db: 18, msre: 0.3, msre_render_noise: 0.2 }, ["18.0 dB, mostly noise of the re-render"]],
    [{ psnr_db: 26, msre: 0.01, msre_render_noise: 0.001 }, ["26.0 dB, agrees but for details"]],
  ];
  for (const [metrics, wanted] of cases) {
    const found = await page.evaluate(async (m) => (await import("/web/verdict.js")).verdictOf(m), metrics);
    check(found[0] === wanted[0], `${JSON.stringify(metrics)} is called ${found[0]}`);
  }
}

// --- sending a room ---------------------------------------------------------------------------

// A folder that is dropped is sent as a whole, files in folders of it too, and what is hidden is not.
async function dropFolder(page, files) {
  await page.evaluate(async (files) => {
    const entry = (name, parts) => typeof parts === "string"
      ? { name, isFile: true, file: (done) => done(new File([Uint8Array.from(atob(parts), (c) => c.charCodeAt(0))], name, { lastModified: 7 })) }
      : { name, isDirectory: true, createReader: () => {
        const children = Object.entries(parts).map(([child, inside]) => entry(child, inside));
        return { readEntries: (done) => done(children.splice(0, 5)) }; // some at a time, as browsers do
      } };
    const event = new Event("drop", { bubbles: true, cancelable: true });
    event.dataTransfer = { items: [{ webkitGetAsEntry: () => entry("dropped", files) }], files: [] };
    window.dispatchEvent(event);
  }, files);
  await page.waitForFunction(() => !document.getElementById("check").hidden, { timeout: 60000 });
  await page.waitForFunction(() => document.getElementById("check-progress").hidden, { timeout: 60000 });
  check(await page.$eval("#check-name", (name) => name.textContent) === "dropped", "the dropped room has another name");
  const [scene] = (await get("scenes?limit=1")).items;
  check(scene.state === "ready" && scene.name === "dropped", `the dropped room: ${JSON.stringify(scene.problems)}`);
}

// An upload whose connection breaks off in the middle goes on; so does one whose page was closed, where it stopped.
async function resumeUpload(files) {
  const big = { ...files, "noise.bin": Buffer.alloc(9 << 20, 5).toString("base64") }; // two parts
  let page = await open(""), parts = 0;
  await page.waitForSelector("#jobs button");
  await page.setRequestInterception(true);
  page.on("request", (request) => {
    if (request.method() === "PATCH" && request.url().includes("/v1/uploads/") && ++parts > 1) request.abort("connectionreset");
    else request.continue();
  });
  dropFolder(page, big).catch(() => {}); // it is left
  await page.waitForFunction(() => document.getElementById("sent-words").textContent.includes("trying again"), { timeout: 60000 });
  await page.close();
  const [upload] = (await get("uploads?limit=1")).items;
  check(upload.offset > 0 && upload.offset < upload.length, `the upload broke off at ${upload.offset} of ${upload.length}`);
  page = await open("");
  await page.waitForSelector("#jobs button");
  let first = null;
  page.on("request", (request) => { if (request.method() === "PATCH") first ??= Number(request.headers()["upload-offset"]); });
  await dropFolder(page, big);
  check(first === upload.offset, `it goes on at ${first}, not at ${upload.offset}`);
  await page.close();
}

// --- the room ---------------------------------------------------------------------------------

// Code values of red, in the page.
const meanOfImage = (image) => {
  const canvas = new OffscreenCanvas(image.naturalWidth, image.naturalHeight), paint = canvas.getContext("2d");
  paint.drawImage(image, 0, 0);
  const { data } = paint.getImageData(0, 0, canvas.width, canvas.height);
  return data.reduce((sum, x, i) => sum + (i % 4 === 0 ? x : 0), 0) / (data.length / 4);
};

// The line between photograph and re-render is where it is drawn to, also where there are margins beside the pictures.
async function dragLine() {
  const page = await open("#job=1", { width: 1200, height: 500 });
  await page.waitForFunction(() => document.querySelector("#job .compare canvas")?.width >= 1000);
  const found = await page.$eval("#job .compare", (figure) => {
    const canvas = figure.querySelector("canvas"), box = canvas.getBoundingClientRect();
    const shown = Math.min(box.width, box.height * canvas.width / canvas.height), clientX = box.left + (box.width - shown) / 2 + shown / 4;
    canvas.dispatchEvent(new PointerEvent("pointerdown", { buttons: 1, clientX }));
    return { value: Number(figure.querySelector("input").value), margin: (box.width - shown) / 2 };
  });
  check(found.margin > 50 && found.value === 25, `the line: ${JSON.stringify(found)}`);
  await page.close();
}

// The picture from where the room is looked at shows what the room in three dimensions shows; when one walks, the camera is
// inside.
async function renderFromRoom() {
  const page = await open("#job=1");
  await page.waitForFunction(() => document.querySelectorAll("#job .room-segment option").length > 1);
  await page.$eval("#job .view-small", (button) => button.click());
  await page.waitForSelector("#job .view-figure:not([hidden])", { timeout: 60000 });
  check(await page.$eval("#job .view-image", meanOfImage) > 20, "from outside one does not look into the room");
  await page.click("#job .room-walk");
  await page.$eval("#job .view-small", (button) => button.click());
  await page.waitForFunction((before) => document.querySelector("#job .view-caption").textContent !== before, { timeout: 60000 },
    await page.$eval("#job .view-caption", (caption) => caption.textContent));
  const looks = (await get("jobs?kind=render")).items.filter(({ name }) => name.endsWith(", a look"));
  check(looks.length === 2 && looks[0].settings.cameras === "view.json", `the looks: ${JSON.stringify(looks)}`);
  const { frames } = await get(`jobs/${looks[0].id}/outputs/views.json`), m = frames[0].transform_matrix;
  check([0, 1, 2].every((r) => Math.abs(m[r][3]) < 0.1), `it looks from ${JSON.stringify(m)}, not from the room's middle`);
  check(Math.abs(m[1][1] - 1) < 1e-3, `the camera is not upright: ${JSON.stringify(m)}`);
  await page.select("#job .room-segment", "5"); // a wall is hidden, and not rendered
  await page.click("#job .room-hide");
  await page.$eval("#job .view-small", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#job .view-caption").textContent.includes("without what is hidden (1)"));
  const without = (await get("jobs?kind=render")).items.find(({ settings }) => settings.remove !== undefined);
  check(without?.settings.remove === "5", `what is hidden: ${JSON.stringify(without)}`);
  await page.$eval("#job .view-large", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#job .name").textContent.endsWith(", a view"));
  const id = new URLSearchParams((await page.evaluate(() => location.hash)).slice(1)).get("job"), job = await get(`jobs/${id}`);
  check(job.settings.size.startsWith("1280x"), `large: ${JSON.stringify(job.settings)}`);
  await fetch(`${url}/v1/jobs/${id}/cancel`, { method: "POST" });
  await page.close();
}

// What is seen first is a room, however many looks at it are newer; of a look, its pictures, which fill the page.
async function openFirst() {
  const page = await open("");
  await page.waitForSelector("#job .compare:not([hidden])");
  const [look] = (await get("jobs?kind=render")).items.filter(({ state, settings }) => state === "succeeded" && settings.cameras);
  await page.evaluate((id) => { location.hash = `#job=${id}`; }, look.id);
  await page.waitForSelector("#job .renders img[src]");
  const shown = await page.$eval("#job", (job) => ({ width: job.querySelector(".renders img").clientWidth,
    titles: [...job.querySelectorAll(".renders figcaption")].map((f) => f.textContent), figures: job.querySelector(".figures").textContent }));
  check(shown.width > 400 && shown.titles.join() === "Picture 1, radiance" && shown.figures.includes("job 1"), `a look: ${JSON.stringify(shown)}`);
  await page.close();
}

const page = await open("");
await page.waitForSelector("#jobs button");
await saveSettings(page);
await judge(page);
await dropFolder(page, readFolder(room));
await resumeUpload(readFolder(room));
await timeMix(page);
await makeLights();
await compareSum(page);
await page.close();
await mixLights();
await failLights();
await dragLine();
await renderFromRoom();
await openFirst();
await browser.close();
process.exit(faults > 0 ? 1 : 0);
