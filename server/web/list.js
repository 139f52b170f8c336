// list.js -- the list of jobs: searched by name, owner, number and label, filtered by state, opened by click and key.

import { $, element, showEach } from "./dom.js";
import { go, place } from "./address.js";

const number = (text) => (text === undefined ? null : Number(text));

function words(job) {
  const labels = Object.entries(job.labels ?? {}).flatMap(([name, value]) => [name, value, `${name}=${value}`]);
  return [String(job.id), job.name, job.owner ?? "", job.kind ?? "", ...labels].join("\n").toLowerCase();
}

// Every word of the search is somewhere in what is known of the job.
export function matches(job, { q = "", state = "" }) {
  const text = words(job);
  return (!state || job.state === state) && q.toLowerCase().split(/\s+/).every((word) => text.includes(word));
}

function open(event, id) {
  if (event.ctrlKey || event.metaKey || event.shiftKey) go({ with: id }); // beside the one that is open
  else go({ job: id, with: null });
}

function makeRow(job) {
  const row = element("tr", null), first = element("td", null), bar = element("td", null);
  first.append(element("button", job.id, { type: "button", ariaLabel: `open job ${job.id}` }));
  bar.append(element("progress", null, { max: 1, ariaLabel: `progress of job ${job.id}` }));
  row.append(first, element("td", null), element("td", null), bar, element("td", null));
  row.addEventListener("click", (event) => open(event, job.id));
  row.addEventListener("keydown", (event) => {
    const step = { ArrowDown: "nextElementSibling", ArrowUp: "previousElementSibling" }[event.key];
    if (!step) return;
    event.preventDefault();
    row[step]?.querySelector("button").focus();
  });
  return row;
}

function fillRow(row, job) {
  const [first, name, state, bar, owner] = row.children, here = place();
  const isChosen = [number(here.job), number(here.with)].includes(job.id);
  row.className = isChosen ? "chosen" : "";
  first.firstChild.ariaCurrent = isChosen ? "true" : "false";
  name.textContent = job.name;
  name.title = Object.entries(job.labels ?? {}).map(([label, value]) => `${label}: ${value}`).join(", ");
  state.textContent = job.kind && job.kind !== "reconstruct" ? `${job.kind}, ${job.state}` : job.state;
  bar.firstChild.hidden = job.state !== "running";
  bar.firstChild.value = job.progress;
  owner.textContent = job.owner ?? "";
}

export function showList(jobs) {
  const here = place();
  const newest = [...jobs.values()].filter((job) => matches(job, here)).sort((a, b) => b.id - a.id);
  showEach($("jobs"), newest, (job) => job.id, makeRow, fillRow);
  $("no-jobs").hidden = newest.length > 0;
  $("no-jobs").textContent = jobs.size > 0 ? "No job matches." : "No jobs yet.";
  if ($("search").value !== (here.q ?? "")) $("search").value = here.q ?? "";
  if ($("state").value !== (here.state ?? "")) $("state").value = here.state ?? "";
}

$("search").addEventListener("input", () => go({ q: $("search").value.trim() }, true));
$("state").addEventListener("change", () => go({ state: $("state").value }));
$("filter").addEventListener("submit", (event) => {
  event.preventDefault();
  $("jobs").querySelector("button")?.click();
});
