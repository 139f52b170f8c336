// check.mjs -- what the page shows of a room's check: while it goes on, a fit that is doubtful, a refused room and its remedy, a
// room that cannot be used.
//
// node check.mjs NODE_MODULES CHROMIUM IDLE FOLDER PICTURES: IDLE is tests/api/idle, whose scene's check finds what is said here;
// FOLDER has overlay_000.png and plan.png; a line for each fault
import { spawn } from "node:child_process";
import { cpSync } from "node:fs";
import { createInterface } from "node:readline";
import { launch, look, lookAll, modules as loaded } from "./browser.mjs";

const [modules, chromium, idlePath, folder, pictures] = process.argv.slice(2);
const idle = spawn(idlePath, { stdio: ["pipe", "pipe", "inherit"] }), lines = createInterface(idle.stdout)[Symbol.asyncIterator]();
const [url, scene, data] = (await lines.next()).value.split(" ");
const { puppeteer, axe } = loaded(modules), browser = await launch(puppeteer, chromium);
let faults = 0;

function check(isRight, words) {
  if (isRight) return;
  faults++;
  console.log(`fault: ${words}`);
}

// The check tells facts, or ends.
async function move(word, facts) {
  idle.stdin.write(`${word} ${JSON.stringify(facts)}\n`);
  const answer = (await lines.next()).value;
  check(answer === "ok", `${word}: ${answer}`);
}

const read = (reading) => fetch(`${url}/v1/scenes/${scene}`, { method: "PATCH", headers: { "Content-Type": "application/json" },
  body: JSON.stringify({ reading }) });

async function open(hash) {
  const page = await browser.newPage();
  page.on("pageerror", (error) => check(false, `a script fails: ${error.message}`));
  await page.setViewport({ width: 1400, height: 900 });
  await page.goto(`${url}/${hash}`);
  return page;
}

// What one sees of it.
const shown = (page) => page.evaluate(() => {
  const at = (id) => document.getElementById(id), isSeen = (id) => at(id).checkVisibility();
  return {
    words: at("check-state").textContent, isBad: at("check-state").className === "bad", goesOn: isSeen("check-progress"),
    evidence: at("check-evidence").innerText, warnings: at("check-warnings").innerText, problems: at("check-problems").innerText,
    table: [...at("check-table").rows].map((row) => row.innerText), hasTable: isSeen("check-facts"),
    pictures: [...at("check-pictures").querySelectorAll("img")].filter((image) => image.naturalWidth > 0).map((image) => image.alt),
    remedy: isSeen("check-remedy") ? at("remedy-text").textContent : "", applies: isSeen("apply-remedy"),
    start: isSeen("start") ? at("start-button").textContent : "",
  };
});
const until = (page, words) => page.waitForFunction(words, { timeout: 60000, polling: 100 });

const TABLE = [{ label: "frames used", value: "11 of 12, images/7.png left out" }, { label: "mesh", value: "12 triangles, 96 m²" },
  { label: "texture", value: "2048 texels: 3.1 mm each" }, { label: "time", value: "about 4 min" }];
const PREVIEWS = [{ name: "overlay_000.png", caption: "images/0.png, edges of the mesh over it" }, { name: "plan.png", caption: "from above" }];
const WARNINGS = ["images/7.png: is truncated; the frame is left out"];
const DOUBTFUL = { verdict: "doubtful", evidence: ["the walls are plain: photographs would agree under other poses, too"] };
const REFUSED = { verdict: "no", evidence: ["93 of 100 rays of photographs hit nothing", "turned, 96 of 100 hit, and agree within 3 %"],
  remedy: { mesh_axes: "x -z y" }, remedy_text: "The mesh is y-up: it is to be read with mesh_axes=x -z y.", taken: false };

// Each fact is there as soon as it is told, and nothing can be started before the end.
async function watch(page) {
  await until(page, () => document.getElementById("check-state").textContent === "The room is being checked.");
  let now = await shown(page);
  check(now.goesOn && !now.hasTable && now.start === "" && now.pictures.length === 0, `at the beginning: ${JSON.stringify(now)}`);
  await move("tell", { triangle_count: 12, warnings: WARNINGS });
  await until(page, () => document.getElementById("check-warnings").innerText.includes("is truncated"));
  await move("tell", { warnings: WARNINGS, fit: DOUBTFUL, table: TABLE, previews: [] });
  await until(page, () => document.getElementById("check-table").rows.length === 4);
  now = await shown(page);
  check(now.goesOn && now.hasTable && now.evidence.includes("plain") && now.start === "", `with a table: ${JSON.stringify(now)}`);
  await move("tell", { warnings: WARNINGS, fit: DOUBTFUL, table: TABLE, previews: PREVIEWS.slice(0, 1) });
  await until(page, () => document.querySelector("#check-pictures img")?.naturalWidth > 0);
  now = await shown(page);
  check(now.goesOn && now.pictures.length === 1 && now.start === "", `with an overlay: ${JSON.stringify(now)}`);
  faults += await look(page, axe, pictures, "check-goes-on");
  await move("ready", { warnings: WARNINGS, fit: DOUBTFUL, table: TABLE, previews: PREVIEWS });
}

async function doubt(page) {
  await until(page, () => document.getElementById("start").checkVisibility() && document.querySelectorAll("#first-settings label").length > 0);
  await until(page, () => [...document.querySelectorAll("#check-pictures img")].filter((image) => image.naturalWidth > 0).length === 2);
  const now = await shown(page);
  check(now.words.includes("cannot be told") && !now.isBad && !now.goesOn && now.remedy === "" && now.start === "Start",
    `a doubtful fit: ${JSON.stringify(now)}`);
  const first = await page.$eval("#first-settings .setting", (setting) => setting.innerText);
  check(/^texture size/.test(first) && first.length > 40, `the first setting is: ${first}`);
  const settings = (await (await fetch(`${url}/v1/settings`)).json()).items;
  const lacking = await page.evaluate((names) => names.filter((name) =>
    !document.getElementById(`setting-${name}`) || document.getElementById(`setting-${name}-help`).textContent === ""), settings.map(({ name }) => name));
  check(settings.length > 30 && lacking.length === 0, `settings without a field or help: ${lacking}`);
  faults += await lookAll(page, axe, pictures, "check-doubtful");
}

// Pictures open large, and the arrow keys go from one to the next.
async function enlarge(page) {
  await page.$eval("#check-pictures button", (button) => button.click());
  const caption = () => page.$eval("#large", (dialog) => dialog.open && dialog.querySelector("#large-caption").textContent);
  check(await caption() === PREVIEWS[0].caption, `large: ${await caption()}`);
  await page.keyboard.press("ArrowRight");
  check(await caption() === PREVIEWS[1].caption, `the next one: ${await caption()}`);
  await page.keyboard.press("Escape");
  check(await caption() === false, "it stays open");
}

// A room that does not fit can be put right, or be started all the same.
async function refuse(page) {
  await until(page, () => document.getElementById("start").checkVisibility());
  const now = await shown(page);
  check(now.words === "Mesh and photographs do not fit." && now.isBad && now.start === "Start all the same", `a refused room: ${JSON.stringify(now)}`);
  check(now.evidence.includes("93 of 100") && now.remedy.includes("y-up") && now.applies, `its remedy: ${JSON.stringify(now)}`);
  faults += await lookAll(page, axe, pictures, "check-refused");
  await page.$eval("#apply-remedy", (button) => button.click());
  await until(page, () => document.getElementById("check-progress").checkVisibility());
  const { reading, state } = await (await fetch(`${url}/v1/scenes/${scene}`)).json();
  check(state === "checking" && reading.mesh_axes === "x -z y", `applied: ${state}, ${JSON.stringify(reading)}`);
  await move("ready", { fit: { verdict: "yes", evidence: [] }, table: TABLE, previews: PREVIEWS });
}

// From the job that is looked at back to its room.
async function again(page) {
  await page.waitForFunction(() => document.querySelector("#job .again")?.checkVisibility());
  await page.$eval("#job .again", (button) => button.click());
  await until(page, () => document.getElementById("start").checkVisibility());
}

// What is not a default is sent, and the page goes to the job. Another on its room begins with its settings.
async function start(page) {
  await until(page, () => document.getElementById("check-state").textContent === "Mesh and photographs fit.");
  await page.$eval("#setting-texture_size", (field) => { field.value = 512; });
  await page.$eval("#start-button", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#job .state")?.textContent === "queued");
  check(await page.evaluate(() => location.hash) === "#job=1", "the address is not the job's");
  const { settings } = await (await fetch(`${url}/v1/jobs/1`)).json();
  check(JSON.stringify(settings) === '{"texture_size":512}', `settings: ${JSON.stringify(settings)}`);
  const also = { texture_size: 1024, calibrate: false, "emitters.3": "on" };
  await fetch(`${url}/v1/jobs`, { method: "POST", headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ scene, settings: also }) });
  await page.reload();
  await page.evaluate(() => { location.hash = "#job=2"; });
  await again(page);
  const like = await page.$eval("#start-like", (line) => line.textContent);
  check(like === "Settings of job 2, also emitters.3 = on.", `what the form begins with: ${like}`);
  await page.$eval("#setting-texture_size", (field) => { field.value = 512; });
  await page.$eval("#start-button", (button) => button.click());
  await page.waitForFunction(() => location.hash === "#job=3");
  const next = await (await fetch(`${url}/v1/jobs/3`)).json();
  const wanted = { ...also, texture_size: 512 };
  check(Object.keys(wanted).every((name) => next.settings[name] === wanted[name]), `settings of the next: ${JSON.stringify(next.settings)}`);
  await again(page);
}

async function reject(page) {
  await move("reject", [{ file: "mesh.ply", reason: "ends in the middle of vertex 4", hint: "export it again" }]);
  await until(page, () => document.getElementById("check-state").textContent === "The room cannot be used.");
  const now = await shown(page);
  check(now.isBad && now.problems.includes("mesh.ply: ends in the middle of vertex 4. export it again") && now.start === "",
    `a rejected room: ${JSON.stringify(now)}`);
  faults += await look(page, axe, pictures, "check-rejected");
}

cpSync(folder, `${data}/scenes/${scene}/previews`, { recursive: true });
await read({});
const page = await open(`#scene=${scene}`);
await watch(page);
await doubt(page);
await page.setViewport({ width: 1400, height: 900 });
await enlarge(page);
await read({});
await move("ready", { fit: REFUSED, warnings: WARNINGS, table: TABLE, previews: PREVIEWS });
await page.reload(); // the address keeps the room
await refuse(page);
await start(page);
await read({ scale: 0.5 });
await page.reload();
await reject(page);
await page.goto(`${url}/#scene=${"f".repeat(64)}`);
await until(page, () => document.getElementById("submit-problem").textContent !== "");
await browser.close();
idle.stdin.end();
process.exit(faults > 0 ? 1 : 0);
