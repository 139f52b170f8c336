// page.js -- the web page: who is signed in, the jobs of the server as they go on, and one or two of them closely.

import { $, bytes } from "./dom.js";
import { get, onSignedOut } from "./api.js";
import { go, onMove, place } from "./address.js";
import { forgetCheck, onStarted, showScene } from "./check.js";
import { JobView } from "./job.js";
import { showList } from "./list.js";
import { forgetUsers, showUsers } from "./users.js";

const DAY_MS = 86400000, WARN_DAYS = 14;  // before a token ends
const PAGES_MAX = 20, PAGE_JOBS = 200; // of the list

const server = { me: null, jobs: new Map(), refresh }; // me: {user, role, open}; jobs: by number
const views = [new JobView("job", server), new JobView("with", server)];
let stream = null; // events of all jobs

// --- signing in -----------------------------------------------------------------------------

function showSignIn(why) {
  $("sign-in-problem").textContent = why;
  stream?.close();
  stream = null;
  $("work").hidden = true;
  $("sign-in").hidden = false;
  $("sign-out").hidden = true;
  $("who").textContent = "";
  $("token").focus();
}
onSignedOut(showSignIn);

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
  server.jobs.clear();
  forgetCheck();
  forgetUsers();
  go({ job: null, with: null, scene: null, like: null });
  start();
});

// What is kept changes with every job.
function showWho() {
  const { me } = server, limit = me.kept_bytes_max ? ` of ${bytes(me.kept_bytes_max)}` : "";
  const left = me.expires_at ? (new Date(me.expires_at) - Date.now()) / DAY_MS : Infinity;
  const ends = left < WARN_DAYS ? `; your token ends on ${new Date(me.expires_at).toLocaleString()}` : "";
  const who = me.user ? `${me.user} (${me.role})` : "open to everybody who reaches it";
  $("who").textContent = `${who}; ${bytes(me.kept_bytes)}${limit} kept${ends}`;
}

async function updateWho() {
  server.me = (await get("v1/session").catch(() => null)) || server.me;
  showWho();
}

// --- jobs -----------------------------------------------------------------------------------

function showPlace() {
  const here = place();
  for (const view of views) {
    const id = Number(here[view.slot]) || null;
    view.choose(server.jobs.has(id) ? id : null);
  }
  $("jobs-shown").classList.toggle("two", $("jobs-shown").children.length > 1);
  showList(server.jobs);
  if (server.me) showScene();
}
onMove(showPlace);

// One request for a job however many events about it come at once.
const asked = new Set();
function refresh(id) {
  if (asked.has(id)) return;
  asked.add(id);
  setTimeout(async () => {
    asked.delete(id);
    try {
      server.jobs.set(id, await get(`v1/jobs/${id}`));
    } catch (problem) { // a busy server's 503 does not take a job off the list
      if (problem.status === 404 || problem.status === 403) server.jobs.delete(id); // gone, or no longer shared
    }
    showPlace();
  }, 200);
}

function follow() {
  stream?.close();
  stream = new EventSource("v1/events");
  for (const type of ["state", "progress"])
    stream.addEventListener(type, (event) => refresh(JSON.parse(event.data).job));
  stream.addEventListener("state", updateWho);
  const viewsOf = (data) => views.filter((view) => view.id === data.job && view.root);
  stream.addEventListener("metric", (event) => {
    const data = JSON.parse(event.data);
    if (data.series === "loss") for (const view of viewsOf(data)) view.addToCurve(data);
  });
  for (const type of ["preview", "output"])
    stream.addEventListener(type, (event) => {
      for (const view of viewsOf(JSON.parse(event.data))) view.showOutputsSoon();
    });
  stream.addEventListener("resync", loadJobs);
  stream.onerror = () => get("v1/session").catch(() => {}); // signed out, or revoked?
}

async function loadJobs() {
  const all = new Map();
  let cursor = "";
  for (let i = 0; i < PAGES_MAX && cursor !== null; i++) {
    const page = await get(`v1/jobs?limit=${PAGE_JOBS}${cursor && `&cursor=${encodeURIComponent(cursor)}`}`);
    for (const job of page.items) all.set(job.id, job);
    cursor = page.next ?? null;
  }
  server.jobs = all;
  showPlace();
}

onStarted((job) => {
  server.jobs.set(job.id, job);
  go({ job: job.id, with: null, scene: null, like: null });
});

// --- start ----------------------------------------------------------------------------------

async function start() {
  server.me = await get("v1/session").catch(() => null);
  if (!server.me) return;
  $("sign-in").hidden = true;
  $("work").hidden = false;
  $("sign-out").hidden = server.me.open;
  $("new").hidden = server.me.role === "viewer";
  showWho();
  showUsers(server.me);
  await loadJobs();
  const done = [...server.jobs.values()].filter((job) => job.state === "succeeded").sort((a, b) => b.id - a.id);
  const newest = done.find((job) => job.kind !== "render") ?? done[0];
  if (!place().job && newest) go({ job: newest.id }, true); // what one sees first is a room, not a look at one
  if (server.jobs.size === 0) $("new").open = true;
  follow();
}

start();
