// axe.mjs -- what axe-core finds in the web page (signing in, the list, the check of a room, a job, with its files and log open) and in a
// report, in a light and in a dark browser: a line for each fault, and pictures of what it looked at.
//
// node axe.mjs NODE_MODULES CHROMIUM URL TOKEN REPORT ROOM PICTURES: ROOM-light.tar and ROOM-dark.tar are sent
import { launch, look as lookAt, modules as loaded } from "./browser.mjs";

const [modules, chromium, url, token, report, room, pictures] = process.argv.slice(2);
const { puppeteer, axe } = loaded(modules);

const browser = await launch(puppeteer, chromium);
let faults = 0;

async function look(page, name) { faults += await lookAt(page, axe, pictures, name); }

// A check that found what a check can find: the server's own finds little to say of a grey cube.
const PIXEL = Buffer.from("iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg==", "base64");
const FACTS = {
  fit: { verdict: "no", evidence: ["93 of 100 rays hit nothing"], remedy: { exposures: "ignored" },
    remedy_text: "the exposures are those of another capture", taken: false },
  warnings: ["images/7.png is blurred"],
  table: [{ label: "frames used", value: "11 of 12" }],
  previews: [{ name: "plan.png", caption: "from above" }],
};
async function pretend(page) {
  await page.setRequestInterception(true);
  page.on("request", (request) => {
    const [, id, name] = /\/v1\/scenes\/([0-9a-f]{64})(\/preview\/.*)?$/.exec(request.url()) ?? [];
    const previews = FACTS.previews.map((preview) => ({ ...preview, href: `/v1/scenes/${id}/preview/${preview.name}` }));
    if (name) request.respond({ contentType: "image/png", body: PIXEL });
    else if (!id || request.method() !== "GET" || !page.pretends) request.continue();
    else request.respond({ contentType: "application/json", body: JSON.stringify(
      { id, name: "room", state: "ready", problems: [], facts: { ...FACTS, previews } }) });
  });
  page.pretends = true;
}

// A room is sent, and what its check found is shown before anything is started; the remedy is applied, which has it
// checked again.
async function checkARoom(page, scheme) {
  await pretend(page);
  await page.$eval("#new", (details) => { details.open = true; });
  await (await page.$("#archive")).uploadFile(`${room}-${scheme}.tar`);
  await page.$eval("#submit-button", (button) => button.click());
  await page.waitForSelector("#check-pictures img[src]", { visible: true });
  await page.waitForFunction(() => document.getElementById("start-button").textContent === "Start all the same");
  await look(page, `check-${scheme}`);
  page.pretends = false;
  const reply = page.waitForResponse((response) => response.request().method() === "PATCH");
  await page.$eval("#apply-remedy", (button) => button.click());
  const patched = await (await reply).json();
  if (patched.reading?.exposures !== "ignored") console.log(`check-${scheme}: the remedy is not applied`, ++faults);
  await page.waitForFunction(() => document.getElementById("start-button").textContent === "Start");
  if (scheme !== "dark") return; // once, at the end: what waits has no progress to look at
  const jobs = await page.$$eval("#jobs tr", (rows) => rows.length);
  await page.$eval("#start-button", (button) => button.click());
  await page.waitForFunction((before) => document.querySelectorAll("#jobs tr").length > before, {}, jobs);
}

// What can be done with a job that runs: its button outlives the job's events.
async function holdAnAction(page, scheme) {
  await page.$eval("#jobs tr:first-child button", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#job .actions button")?.textContent === "pause");
  await page.evaluate(() => {
    window.held = document.querySelector("#job .actions button");
    window.held.focus();
    window.before = document.querySelector("#job .job-progress").value;
  });
  await page.waitForFunction(() => document.querySelector("#job .job-progress").value !== window.before);
  if (!(await page.evaluate(() => document.activeElement === window.held)))
    console.log(`job-${scheme}: the focus is lost`, ++faults);
}

// The room in three dimensions is drawn, its segments are picked by the mouse, and the slider moves.
async function lookIntoTheRoom(page, scheme) {
  await page.waitForFunction(() => document.querySelectorAll("#job .room-segment option").length > 1);
  await page.$eval("#job .room-canvas", (canvas) => canvas.scrollIntoView({ block: "center" }));
  await new Promise((done) => setTimeout(done, 300));
  const box = await (await page.$("#job .room-canvas")).boundingBox();
  await page.mouse.click(box.x + box.width / 2, box.y + box.height / 2);
  const values = await page.waitForFunction(() => document.querySelector("#job .room-values")?.textContent || false)
    .then((handle) => handle.jsonValue());
  if (!/roughness\d/.test(values)) console.log(`job-${scheme}: a segment's values are ${values}`, ++faults);
  await page.click("#job .room-lamp");
  const correct = await page.$eval("#job .room-correct", (button) => button.hidden ? "" : button.textContent);
  if (!correct.includes("1 correction")) console.log(`job-${scheme}: the correction is not offered`, ++faults);
  const drawn = () => page.$eval("#job .compare canvas", (canvas) => canvas.toDataURL());
  const before = await drawn();
  await page.$eval("#job .compare input", (range) => {
    range.value = 90;
    range.dispatchEvent(new Event("input"));
  });
  if ((await drawn()) === before) console.log(`job-${scheme}: the slider does nothing`, ++faults);
}

// An admin makes a token, which is shown once, sees who there is, and revokes it.
async function makeAToken(page, scheme) {
  await page.$eval("#people summary", (summary) => summary.click());
  await page.waitForFunction(() => document.querySelectorAll("#users tr").length > 0);
  await page.type("#token-user", `guest-${scheme}`);
  await page.$eval("#add-token button", (button) => button.click());
  await page.waitForFunction(() => document.getElementById("new-token-text").value.startsWith("unbake_"));
  await page.waitForFunction((name) => document.getElementById("users").textContent.includes(name), {}, `guest-${scheme}`);
  await look(page, `people-${scheme}`);
  const made = await page.$eval("#new-token-text", (field) => field.value);
  const session = (token) => fetch(`${url}/v1/session`, { headers: { Authorization: `Bearer ${token}` } });
  const { role, expires_at } = await (await session(made)).json(), days = (new Date(expires_at) - Date.now()) / 86400000;
  if (role !== "user" || !(days > 89 && days <= 90)) console.log(`people-${scheme}: a token of role ${role} for ${days} days`, ++faults);
  await page.$eval("#tokens tr:last-child button", (button) => button.click());
  await page.waitForFunction((name) => !document.getElementById("tokens").textContent.includes(name), {}, `guest-${scheme}`);
  if ((await session(made)).status !== 401) console.log(`people-${scheme}: the token is not revoked`, ++faults);
}

async function lookAtAll(scheme) {
  const context = await browser.createBrowserContext(), page = await context.newPage();
  await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
  await page.setViewport({ width: 1200, height: 900 });
  await page.goto(url);
  await page.waitForSelector("#token", { visible: true });
  await page.type("#token", "unbake_1_wrong");
  await page.click("#sign-in button");
  await page.waitForFunction(() => document.getElementById("sign-in-problem").textContent);
  await look(page, `sign-in-${scheme}`);
  await page.type("#token", token);
  await page.click("#sign-in button");
  await page.waitForSelector("#jobs button");
  await look(page, `list-${scheme}`);
  // Events change the list in place: the focus stays, and so does the button it is on.
  await page.evaluate(() => {
    window.held = document.querySelector("#jobs button"); // of the job that runs
    window.held.focus();
    window.before = document.querySelector("#jobs progress").value;
  });
  await page.waitForFunction(() => document.querySelector("#jobs progress").value !== window.before);
  if (!(await page.evaluate(() => document.activeElement === window.held && window.held.isConnected)))
    console.log(`list-${scheme}: the focus is lost`, ++faults);
  await page.$eval("#jobs tr:last-child button", (button) => button.click()); // the first job, which is done
  await page.waitForSelector("#job .pictures img[src]");
  await lookIntoTheRoom(page, scheme);
  // Not by the mouse: pictures that arrive move what is below them while it aims.
  for (const summary of ["#job .files-details summary", "#job .log-details summary"])
    await page.$eval(summary, (element) => element.click());
  await page.waitForFunction(() => document.querySelectorAll("#job .files a").length > 5);
  await new Promise((done) => setTimeout(done, 500));
  await look(page, `job-${scheme}`);
  await holdAnAction(page, scheme);
  await checkARoom(page, scheme);
  await makeAToken(page, scheme);
  await page.setViewport({ width: 390, height: 800 });
  await look(page, `job-narrow-${scheme}`);
  await page.goto(`file://${report}`);
  await look(page, `report-narrow-${scheme}`);
  await page.setViewport({ width: 1200, height: 900 });
  await look(page, `report-${scheme}`);
  await context.close();
}

await lookAtAll("light");
await lookAtAll("dark");
await browser.close();
process.exit(faults > 0 ? 1 : 0);
