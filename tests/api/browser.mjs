// browser.mjs -- a headless Chromium for tests of the page, which draws by software.
import { createRequire } from "node:module";

export function modules(folder) {
  const require = createRequire(`${folder}/x.js`);
  return { puppeteer: require("puppeteer-core"), axe: require("axe-core") };
}

export const launch = (puppeteer, executablePath) => puppeteer.launch({
  executablePath, headless: true, args: ["--no-sandbox", "--disable-dev-shm-usage", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
});

// What axe-core finds on the page as it is: a line for each fault. A picture of it is kept. Returns the faults.
export async function look(page, axe, pictures, name) {
  let faults = 0;
  await page.screenshot({ path: `${pictures}/${name}.png`, fullPage: true });
  await page.evaluate(axe.source);
  const { violations, passes } = await page.evaluate(() => window.axe.run({ resultTypes: ["violations"] }));
  for (const { id, help, nodes } of violations)
    for (const node of nodes) {
      faults++;
      console.log(`${name}: ${id}: ${help}: ${node.html.slice(0, 200)} ${node.any[0]?.message ?? ""}`);
    }
  console.log(`${name}: ${passes.length} rules hold`);
  if (await page.evaluate(() => document.documentElement.scrollWidth > window.innerWidth))
    console.log(`${name}: wider than the window`, ++faults);
  return faults;
}

// look, in a light and in a dark browser, on a wide and on a narrow screen.
export async function lookAll(page, axe, pictures, name) {
  let faults = 0;
  for (const scheme of ["light", "dark"])
    for (const width of [1400, 390]) {
      await page.emulateMediaFeatures([{ name: "prefers-color-scheme", value: scheme }]);
      await page.setViewport({ width, height: 900 });
      faults += await look(page, axe, pictures, `${name}-${scheme}-${width}`);
    }
  return faults;
}
