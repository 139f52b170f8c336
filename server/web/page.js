// page.js -- the web page: the jobs of a server as they go on, and one of them closely.
//
// What comes from the server is put into the page as text, never as markup. The token is in a
// cookie that this script cannot read; every request simply carries it.

const $ = (id) => document.getElementById(id);
const TERMINAL = ["succeeded", "failed", "cancelled"];
const ACTIONS = {
  queued: ["pause", "cancel"], running: ["pause", "cancel"], paused: ["resume", "cancel"],
  failed: ["retry"], cancelled: ["retry"], succeeded: [],
};

let me = null;          // {user, role, open}
let jobs = new Map();   // by number, newest first when shown
let chosen = null;      // the number of the job that is looked at closely
let stream = null;      // events of all jobs
let curve = new Map();  // loss by iteration, of the chosen job

async function ask(path, options = {}) {
  const reply = await fetch(path, options);
  if (reply.status === 401) {
    showSignIn();
    throw new Error("a token is needed");
  }
  if (!reply.ok) {
    const problem = await reply.json().catch(() => ({}));
    const params = (problem.invalid_params ?? []).map((p) => `${p.name} ${p.reason}`).join("; ");
    const text = [problem.detail ?? `${path}: ${reply.status}`, params, problem.hint].filter(Boolean).join(". ");
    throw Object.assign(new Error(text), { status: reply.status });
  }
  return reply;
}
const get = async (path) => (await ask(path)).json();
const post = (path, body) => ask(path, {
  method: "POST",
  headers: body === undefined ? {} : { "Content-Type": "application/json" },
  body: body === undefined ? undefined : JSON.stringify(body),
});

function element(name, text, attributes = {}) {
  const made = document.createElement(name);
  if (text !== null) made.textContent = text;
  return Object.assign(made, attributes);
}

// The children of `parent` are made to be one for each of `items`, in their order. A child whose key stays is changed
// in place, so that the focus, a selection and a button that is held down outlive an event.
function showEach(parent, items, key, make, fill) {
  const old = new Map([...parent.children].map((child) => [child.dataset.key, child]));
  const children = items.map((item) => {
    const child = old.get(String(key(item))) ?? make(item);
    child.dataset.key = key(item);
    fill(child, item);
    return child;
  });
  for (const child of old.values())
    if (!children.includes(child)) child.remove();
  children.forEach((child, i) => {
    if (parent.children[i] !== child) parent.insertBefore(child, parent.children[i] ?? null);
  });
}

const bytes = (n) =>
  n < 1024 ? `${n} B`
  : n < 2 ** 20 ? `${(n / 1024).toFixed(0)} KiB`
  : n < 2 ** 30 ? `${(n / 2 ** 20).toFixed(1)} MiB`
  : `${(n / 2 ** 30).toFixed(1)} GiB`;
const duration = (s) => s < 90 ? `${Math.round(s)} s` : s < 5400 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;

// --- signing in -----------------------------------------------------------------------------

function showSignIn() {
  stream?.close();
  stream = null;
  $("work").hidden = true;
  $("sign-in").hidden = false;
  $("sign-out").hidden = true;
  $("who").textContent = "";
  $("token").focus();
}

$("sign-in").addEventListener("submit", async (event) => {
  event.preventDefault();
  const reply = await fetch("v1/session", {
    method: "POST", headers: { "Content-Type": "application/json" },
    body: JSON.stringify({ token: $("token").value.trim() }),
  });
  $("sign-in-problem").textContent = reply.ok ? "" : (await reply.json()).detail;
  $("token").value = "";
  if (reply.ok) start();
});

$("sign-out").addEventListener("click", async () => {
  await fetch("v1/session", { method: "DELETE" });
  jobs.clear();
  checked = null;
  showCheck();
  choose(null);
  start();
});

// --- all jobs -------------------------------------------------------------------------------

function makeJobRow(job) {
  const row = element("tr", null), number = element("td", null);
  number.append(element("button", job.id, { onclick: () => choose(job.id) }));
  const bar = element("progress", null, { max: 1, ariaLabel: `progress of job ${job.id}` }), cell = element("td", null);
  cell.append(bar);
  row.append(number, element("td", null), cell, element("td", null), element("td", null));
  return row;
}

function fillJobRow(row, job) {
  const [, state, bar, name, owner] = row.children;
  row.className = job.id === chosen ? "chosen" : "";
  state.textContent = job.state;
  bar.firstChild.hidden = job.state !== "running";
  bar.firstChild.value = job.progress;
  name.textContent = job.name;
  owner.textContent = job.owner ?? "";
}

function showJobs() {
  const newest = [...jobs.values()].sort((a, b) => b.id - a.id);
  showEach($("jobs"), newest, (job) => job.id, makeJobRow, fillJobRow);
  $("no-jobs").hidden = newest.length > 0;
}

// One request for a job however many events about it come at once.
const asked = new Set();
function refresh(id) {
  if (asked.has(id)) return;
  asked.add(id);
  setTimeout(async () => {
    asked.delete(id);
    try {
      jobs.set(id, await get(`v1/jobs/${id}`));
    } catch (problem) { // a busy server's 503 does not take a job off the list
      if (problem.status === 404 || problem.status === 403) jobs.delete(id); // gone, or no longer shared
    }
    showJobs();
    if (id === chosen) showJob();
  }, 200);
}

function follow() {
  stream?.close();
  stream = new EventSource("v1/events");
  for (const type of ["state", "progress"])
    stream.addEventListener(type, (event) => refresh(JSON.parse(event.data).job));
  stream.addEventListener("state", updateWho);
  stream.addEventListener("metric", (event) => {
    const data = JSON.parse(event.data);
    if (data.job === chosen && data.series === "loss") addToCurve(data);
  });
  for (const type of ["preview", "output"])
    stream.addEventListener(type, (event) => {
      if (JSON.parse(event.data).job === chosen) showOutputs();
    });
  stream.addEventListener("resync", loadJobs);
  stream.onerror = () => get("v1/session").catch(() => {}); // signed out, or revoked?
}

async function loadJobs() {
  const page = await get("v1/jobs?limit=100");
  jobs = new Map(page.items.map((job) => [job.id, job]));
  showJobs();
}

// --- one job --------------------------------------------------------------------------------

async function choose(id) {
  chosen = id;
  curve = new Map();
  $("job").hidden = id === null;
  showJobs();
  if (id === null) return;
  $("pictures").replaceChildren();
  $("curve-figure").hidden = true;
  showJob();
  showOutputs();
  showLog();
  const past = await ask(`v1/jobs/${id}/events?after=0&follow=0`, { headers: { Accept: "application/x-ndjson" } });
  if (past.status !== 200) return;
  for (const line of (await past.text()).split("\n").filter(Boolean)) {
    const { event, data } = JSON.parse(line);
    if (event === "metric" && data.series === "loss" && id === chosen) curve.set(data.step, data.value);
  }
  drawCurve();
}

function showJob() {
  const job = jobs.get(chosen);
  if (!job) return choose(null);
  $("job-name").textContent = `${job.id}: ${job.name}`;
  $("job-state").textContent = job.state + (job.wanted === "run" || TERMINAL.includes(job.state) ? "" : `, to ${job.wanted}`);
  $("job-stage").textContent = job.state !== "running" ? "" :
    [job.stage, job.eta_sec !== null ? `${duration(job.eta_sec)} left` : ""].filter(Boolean).join(", ");
  $("job-progress").value = job.state === "succeeded" ? 1 : job.progress;
  $("job-reason").textContent = [job.reason, job.hint].filter(Boolean).join(". ");
  const mine = me.role === "admin" || (me.role === "user" && job.owner === me.user);
  const actions = mine ? [...ACTIONS[job.state] ?? []] : [];
  if (mine && !me.open) actions.push(job.shared ? "unshare" : "share");
  showEach($("actions"), actions, (action) => action, (action) => element("button", action), (button, action) => {
    button.onclick = () => action.endsWith("share") ? share(job) : act(`v1/jobs/${job.id}/${action}`);
  });
}

async function act(path) {
  try {
    await post(path);
  } catch (problem) {
    $("job-reason").textContent = problem.message;
  }
  refresh(chosen);
}

async function share(job) {
  await ask(`v1/jobs/${job.id}`, {
    method: "PATCH", headers: { "Content-Type": "application/json", "If-Match": "*" },
    body: JSON.stringify({ shared: !job.shared }),
  }).catch((problem) => { $("job-reason").textContent = problem.message; });
  refresh(job.id);
}

function addToCurve({ step, value }) {
  curve.set(step, value);
  drawCurve();
}

// Logarithmic in the loss; a thousand points are plenty for 400 pixels.
function drawCurve() {
  const points = [...curve].filter(([, value]) => value > 0).sort((a, b) => a[0] - b[0]);
  $("curve-figure").hidden = points.length < 2;
  if (points.length < 2) return;
  const every = Math.ceil(points.length / 1000);
  const shown = points.filter((_, i) => i % every === 0 || i === points.length - 1);
  const logs = shown.map(([, value]) => Math.log(value));
  const low = Math.min(...logs), high = Math.max(...logs), last = shown.at(-1)[0] || 1;
  const path = shown.map(([step], i) =>
    `${i ? "L" : "M"}${(400 * step / last).toFixed(1)} ${(115 - 110 * (logs[i] - low) / (high - low || 1)).toFixed(1)}`);
  const drawn = document.createElementNS("http://www.w3.org/2000/svg", "path");
  drawn.setAttribute("d", path.join(""));
  $("curve").replaceChildren(drawn);
  $("curve-caption").textContent = `loss ${points.at(-1)[1].toPrecision(3)} at iteration ${points.at(-1)[0]}`;
}

// By fetch, since an image whose URL stays the same is not loaded again when its content changes.
async function load(image, path) {
  const reply = await ask(path).catch(() => null); // it may be replaced just now: the next event tells
  if (!reply) return;
  URL.revokeObjectURL(image.src);
  image.src = URL.createObjectURL(await reply.blob());
}

async function showOutputs() {
  const id = chosen;
  const { items } = await get(`v1/jobs/${id}/outputs`);
  if (id !== chosen) return;
  const pictures = items.filter((o) => /^(preview|compare)\/.*\.png$/.test(o.name)); // others are too large
  showEach($("pictures"), pictures, (output) => output.name, makePicture, fillPicture);
  showEach($("files"), items, (output) => output.name, makeFileRow, fillFileRow);
}

function makePicture(output) {
  const figure = element("figure", null);
  figure.append(element("img", null, { alt: output.name }), element("figcaption", output.name.replace(/^preview\//, "")));
  return figure;
}

function fillPicture(figure, output) {
  if (figure.dataset.sha256 === output.sha256) return;
  figure.dataset.sha256 = output.sha256;
  load(figure.firstChild, output.href.slice(1));
}

function makeFileRow(output) {
  const row = element("tr", null), cell = element("td", null);
  cell.append(element("a", output.name));
  row.append(cell, element("td", null));
  return row;
}

function fillFileRow(row, output) { // a file of the same name may have been another job's
  row.firstChild.firstChild.href = output.href.slice(1);
  row.lastChild.textContent = bytes(output.bytes);
}

async function showLog() {
  if (chosen === null || !$("log-details").open) return;
  $("log").textContent = await (await ask(`v1/jobs/${chosen}/log?bytes=65536`)).text();
}
$("log-details").addEventListener("toggle", showLog);

// --- submitting -----------------------------------------------------------------------------

// XMLHttpRequest, since fetch does not tell how much has been sent.
function send(file) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    const name = file.name.replace(/\.(zip|tar|tar\.gz|tgz|tar\.zst)$/, "").slice(0, 100) || "room";
    request.open("POST", `v1/scenes?name=${encodeURIComponent(name)}`);
    request.setRequestHeader("Content-Type", "application/octet-stream");
    request.upload.onprogress = (event) => { $("sent").value = event.loaded / event.total; };
    request.onerror = () => reject(new Error("the connection broke off"));
    request.onload = () => {
      let body = {};
      try { body = JSON.parse(request.responseText); } catch { /* told by its status */ }
      if (request.status < 300) resolve(body);
      else reject(new Error(body.detail ?? `the server answered ${request.status}`));
    };
    request.send(file);
  });
}

$("submit").addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = event.submitter;
  button.disabled = true;
  $("sent").hidden = false;
  $("submit-problem").textContent = "";
  try {
    const scene = await send($("archive").files[0]);
    $("archive").value = "";
    watchCheck(scene);
  } catch (problem) {
    $("submit-problem").textContent = problem.message;
  }
  $("sent").hidden = true;
  button.disabled = false;
});

// --- the check of a room --------------------------------------------------------------------

const VERDICTS = {
  yes: "Mesh and photographs fit.",
  doubtful: "Whether mesh and photographs fit cannot be told for certain.",
  no: "Mesh and photographs do not fit.",
};
const CHECK_LOOK_MS = 700;
let checked = null; // the scene whose check is shown

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
  updateWho();
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
  $("remedy-text").textContent = (fit?.taken ? "Done by itself: " : "") + (fit?.remedy_text ?? JSON.stringify(fit?.remedy ?? ""));
  $("apply-remedy").hidden = !fit?.remedy || Boolean(fit.taken);
  $("start").hidden = !isReady;
  $("start-button").textContent = fit?.verdict === "no" ? "Start all the same" : "Start";
  showEach($("check-pictures"), previews, ({ name }) => name, makePreview, fillPreview);
  $("check-facts").hidden = table.length === 0;
  showEach($("check-table"), table, ({ label }) => label, makeFact, fillFact);
}

function makePreview() {
  const figure = element("figure", null), link = element("a", null, { target: "_blank" });
  link.append(element("img", null));
  figure.append(link, element("figcaption", null));
  return figure;
}

function fillPreview(figure, { name, caption, href }) {
  const [link, text] = figure.children, image = link.firstChild, path = href.slice(1);
  text.textContent = caption ?? name;
  image.alt = caption ?? name;
  link.href = path;
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
    const reply = await ask(`v1/scenes/${checked.id}`, {
      method: "PATCH", headers: { "Content-Type": "application/json" },
      body: JSON.stringify({ reading: checked.facts.fit.remedy }),
    });
    watchCheck(await reply.json());
  } catch (problem) {
    $("check-problem").textContent = problem.message;
  }
  event.target.disabled = false;
});

$("start").addEventListener("submit", async (event) => {
  event.preventDefault();
  const button = event.submitter;
  button.disabled = true;
  $("check-problem").textContent = "";
  try {
    const settings = { quality: $("quality").value }, minutes = $("minutes").valueAsNumber;
    if (minutes > 0) settings.time_limit_sec = 60 * minutes;
    if (checked.facts.fit?.verdict === "no") settings.fit = "ignore";
    const job = await (await post("v1/jobs", { scene: checked.id, settings })).json();
    jobs.set(job.id, job);
    checked = null;
    showCheck();
    choose(job.id);
  } catch (problem) {
    $("check-problem").textContent = problem.message;
  }
  button.disabled = false;
});

// --- who ------------------------------------------------------------------------------------

function showWho() {
  const limit = me.kept_bytes_max ? ` of ${bytes(me.kept_bytes_max)}` : "";
  const who = me.user ? `${me.user} (${me.role})` : "open to everybody who reaches it";
  $("who").textContent = `${who}; ${bytes(me.kept_bytes)}${limit} kept`;
}

// What is kept changes with every job.
async function updateWho() {
  me = (await get("v1/session").catch(() => null)) || me;
  showWho();
}

// --- start ----------------------------------------------------------------------------------

async function start() {
  me = await get("v1/session").catch(() => null);
  if (!me) return;
  $("sign-in").hidden = true;
  $("work").hidden = false;
  $("sign-out").hidden = me.open;
  $("submit").hidden = me.role === "viewer";
  showWho();
  await loadJobs();
  follow();
}

start();
