// check.js -- a new room: it is sent, its check is shown while it goes on, and a job is started. The address names the
// room, so that a reload keeps its check.

import { $, element, showEach } from "./dom.js";
import { go, place } from "./address.js";
import { get, load, post, send } from "./api.js";
import { openLarge } from "./pictures.js";
import { givenSettings, showSettings, useSettings } from "./settings.js";
import { bundle, chosenFiles, droppedFiles } from "./tar.js";
import { upload } from "./upload.js";

let whenStarted = () => {};
export function onStarted(callback) { whenStarted = callback; }

// --- sending --------------------------------------------------------------------------------

async function sendFiles(files) {
  $("submit-problem").textContent = "";
  $("submit-button").disabled = true;
  $("sent").hidden = false;
  $("sent").value = 0;
  try {
    const scene = await upload(bundle(await files), (share, words) => {
      $("sent").value = share;
      $("sent-words").textContent = words;
    });
    for (const id of ["archive", "folder"]) $(id).value = "";
    named = scene.id;
    model = null;
    await fillForm();
    watchCheck(scene);
    go({ scene: named, like: null });
  } catch (problem) {
    $("submit-problem").textContent = problem.message;
  }
  $("sent").hidden = true;
  $("sent-words").textContent = "";
  $("submit-button").disabled = false;
}

$("submit").addEventListener("submit", (event) => {
  event.preventDefault();
  const chosen = [...$("folder").files, ...$("archive").files];
  if (chosen.length > 0) sendFiles(chosenFiles(chosen));
  else $("submit-problem").textContent = "Choose a folder or an archive, or drop one here.";
});

for (const type of ["dragover", "drop"])
  addEventListener(type, (event) => {
    if ($("work").hidden || $("submit").hidden) return;
    event.preventDefault();
    document.body.classList.toggle("dropping", type === "dragover");
    if (type !== "drop") return;
    $("new").open = true;
    sendFiles(droppedFiles(event.dataTransfer));
  });
addEventListener("dragleave", () => document.body.classList.remove("dropping"));

// --- the check ------------------------------------------------------------------------------

const VERDICTS = {
  yes: "Mesh and photographs fit.",
  doubtful: "Whether mesh and photographs fit cannot be told for certain.",
  no: "Mesh and photographs do not fit.",
};
const CHECK_LOOK_MS = 700;
let checked = null; // the scene whose check is shown
let named = null;   // its id, as the address has it
let model = null;   // number of the job whose settings the form begins with, likewise

// The room that the address names, if any.
export async function showScene() {
  const { scene: id = null, like = null } = place();
  if (id === named && like === model) return;
  forgetCheck();
  named = id;
  model = like;
  if (id === null) return;
  $("new").open = true;
  try {
    const scene = await get(`v1/scenes/${encodeURIComponent(id)}`);
    await fillForm();
    if (named !== id || model !== like) return; // another was chosen meanwhile
    watchCheck(scene);
    $("check").scrollIntoView();
  } catch (problem) {
    if (named === id) $("submit-problem").textContent = problem.message;
  }
}

// Defaults, or the settings of the job that the address names; one that is gone has none.
async function fillForm() {
  const like = model, job = like && await get(`v1/jobs/${encodeURIComponent(like)}`).catch(() => null);
  await showSettings($("first-settings"), $("other-settings"));
  if (like !== model) return;
  const others = useSettings($("start"), job?.settings ?? {});
  $("start-like").textContent = job ? `Settings of job ${job.id}${others && ", also "}${others}.` : "";
}

// Until its check has ended; one that waits for room on the server's disk says so.
async function watchCheck(scene) {
  checked = scene;
  $("check-problem").textContent = "";
  showCheck();
  while (checked?.id === scene.id && checked.state === "checking") {
    await new Promise((done) => setTimeout(done, CHECK_LOOK_MS));
    const now = await get(`v1/scenes/${scene.id}`).catch(() => null); // a busy server is asked again
    if (!now || checked?.id !== scene.id) continue;
    checked = now;
    showCheck();
  }
}

function showLines(id, lines) {
  $(id).hidden = lines.length === 0;
  showEach($(id), [...new Set(lines)], (line) => line, () => element("li", null), (item, line) => { item.textContent = line; });
}

function describeCheck(scene, fit) {
  if (scene.state === "checking") return scene.problems.length > 0 ? "The check waits." : "The room is being checked.";
  if (scene.state === "rejected") return "The room cannot be used.";
  return VERDICTS[fit?.verdict] ?? "The room can be used.";
}

export function forgetCheck() {
  checked = named = model = null;
  $("submit-problem").textContent = "";
  showCheck();
}

function showCheck() {
  const scene = checked;
  $("check").hidden = scene === null;
  if (scene === null) return;
  const { fit, table = [], previews = [], warnings = [] } = scene.facts;
  const isReady = scene.state === "ready";
  $("check-name").textContent = scene.name;
  $("check-state").textContent = describeCheck(scene, fit);
  $("check-state").className = scene.state === "rejected" || fit?.verdict === "no" ? "bad" : "";
  $("check-progress").hidden = scene.state !== "checking";
  showLines("check-problems", scene.problems.map(({ file, reason, hint }) =>
    [file ? `${file}: ${reason}` : reason, hint].filter(Boolean).join(". ")));
  showLines("check-evidence", fit?.evidence ?? []);
  showLines("check-warnings", warnings);
  $("check-remedy").hidden = !fit?.remedy_text && !fit?.remedy;
  $("remedy-text").textContent = (fit?.taken ? "Applied: " : "") + (fit?.remedy_text ?? JSON.stringify(fit?.remedy ?? ""));
  $("apply-remedy").hidden = !fit?.remedy || Boolean(fit.taken) || scene.state === "checking";
  $("start").hidden = !isReady;
  $("start-button").textContent = fit?.verdict === "no" ? "Start all the same" : "Start";
  showEach($("check-pictures"), previews, ({ name }) => name, makePreview, fillPreview);
  $("check-facts").hidden = table.length === 0;
  showEach($("check-table"), table, ({ label }) => label, makeFact, fillFact);
}

function makePreview() {
  const figure = element("figure", null), button = element("button", null, { type: "button" });
  button.append(element("img", null));
  button.addEventListener("click", () => openLarge($("check-pictures"), figure));
  figure.append(button, element("figcaption", null));
  return figure;
}

function fillPreview(figure, { name, caption, href }) {
  const image = figure.querySelector("img"), path = href.slice(1);
  figure.lastChild.textContent = caption ?? name;
  image.alt = `${caption ?? name}, open large`;
  if (figure.dataset.path === path) return;
  figure.dataset.path = path;
  load(image, path);
}

function makeFact() {
  const row = element("tr", null);
  row.append(element("th", null, { scope: "row" }), element("td", null));
  return row;
}

function fillFact(row, { label, value }) {
  row.firstChild.textContent = label;
  row.lastChild.textContent = value;
}

$("apply-remedy").addEventListener("click", async (event) => {
  event.target.disabled = true;
  try {
    const reply = await send("PATCH", `v1/scenes/${checked.id}`, { reading: checked.facts.fit.remedy });
    watchCheck(await reply.json());
  } catch (problem) {
    $("check-problem").textContent = problem.message;
  }
  event.target.disabled = false;
});

$("start").addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = $("start-button");
  button.disabled = true;
  $("check-problem").textContent = "";
  try {
    const settings = givenSettings($("start"));
    if (checked.facts.fit?.verdict === "no") settings.fit = "ignore";
    const job = await (await post("v1/jobs", { scene: checked.id, settings })).json();
    forgetCheck();
    $("new").open = false;
    whenStarted(job);
  } catch (problem) {
    $("check-problem").textContent = problem.message;
  }
  button.disabled = false;
});
