// axe.mjs -- what axe-core finds in the web page (signing in, the list, a job, with its files and log open) and in a
// report, in a light and in a dark browser: a line for each fault, and pictures of what it looked at.
//
// node axe.mjs NODE_MODULES CHROMIUM URL TOKEN REPORT PICTURES
import { createRequire } from "node:module";

const [modules, chromium, url, token, report, pictures] = process.argv.slice(2);
const require = createRequire(`${modules}/x.js`);
const puppeteer = require("puppeteer-core");
const axe = require("axe-core");

const browser = await puppeteer.launch({
  executablePath: chromium, headless: true, args: ["--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"],
});
let faults = 0;

async function look(page, name) {
  await page.screenshot({ path: `${pictures}/${name}.png`, fullPage: true });
  await page.evaluate(axe.source);
  const { violations, passes } = await page.evaluate(() => window.axe.run({ resultTypes: ["violations"] }));
  for (const { id, help, nodes } of violations)
    for (const node of nodes) {
      faults++;
      console.log(`${name}: ${id}: ${help}: ${node.html.slice(0, 200)} ${node.any[0]?.message ?? ""}`);
    }
  console.log(`${name}: ${passes.length} rules hold`);
}

// What can be done with a job that runs: its button outlives the job's events.
async function holdAnAction(page, scheme) {
  await page.$eval("#jobs tr:first-child button", (button) => button.click());
  await page.waitForFunction(() => document.querySelector("#actions button")?.textContent === "pause");
  await page.evaluate(() => {
    window.held = document.querySelector("#actions button");
    window.held.focus();
    window.before = document.getElementById("job-progress").value;
  });
  await page.waitForFunction(() => document.getElementById("job-progress").value !== window.before);
  if (!(await page.evaluate(() => document.activeElement === window.held)))
    console.log(`job-${scheme}: the focus is lost`, ++faults);
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
  await page.waitForSelector("#pictures img[src]");
  // Not by the mouse: pictures that arrive move what is below them while it aims.
  for (const summary of ["#job details:first-of-type summary", "#log-details summary"])
    await page.$eval(summary, (element) => element.click());
  await page.waitForFunction(() => document.querySelectorAll("#files a").length > 5);
  await new Promise((done) => setTimeout(done, 500));
  await look(page, `job-${scheme}`);
  await holdAnAction(page, scheme);
  await page.setViewport({ width: 420, height: 800 });
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
