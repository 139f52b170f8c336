// job.js -- one job closely: its pictures, its room, its figures, what can be done with it. Two may stand side by side.

import { $, bytes, duration, element, isOwn, showEach, showFigures } from "./dom.js";
import { ask, get, post, send } from "./api.js";
import { go } from "./address.js";
import { drawCurve } from "./curve.js";
import { Mixer } from "./light_mixer.js";
import { Slider, showThumbnails } from "./pictures.js";
import { verdictOf } from "./verdict.js";

const TERMINAL = ["succeeded", "failed", "cancelled"];
const ACTIONS = {
  queued: ["pause", "cancel"], running: ["pause", "cancel"], paused: ["resume", "cancel"],
  failed: ["retry"], cancelled: ["retry"], succeeded: [],
};
const OUTPUTS_WAIT_MS = 300;
const PICTURE_MAX = 8 << 20; // bytes; larger ones are opened from the list of files

const isRendered = ({ name }) => /^\d{5}_\w+\.png$/.test(name);
const isComparison = ({ name }) => /^compare\/.*\.png$/.test(name);
const isThumbnail = ({ name, bytes: size }) => /\.png$/.test(name) && size < PICTURE_MAX && name !== "base_color.png";

const goTo = (job) => go({ job: job.id });

export class JobView {
  // slot: "job" or "with", the part of the address; server: {me, jobs, refresh(id)}
  constructor(slot, server) {
    this.slot = slot;
    this.server = server;
    this.id = null;
  }

  at(name) { return this.root.querySelector(`.${name}`); }

  async choose(id) {
    if (id === this.id) return this.show();
    this.id = id;
    this.mixer?.close();
    this.root?.remove();
    this.root = null;
    if (id === null) return;
    this.root = $("job-template").content.firstElementChild.cloneNode(true);
    this.root.id = this.slot === "job" ? "job" : "beside";
    $("jobs-shown").append(this.root);
    this.curve = new Map();
    this.report = null;
    this.reportVersion = null;
    this.room = null;
    this.roomRender = null;
    this.slider = new Slider(this.at("compare"));
    this.mixer = new Mixer(this.at("mixer"), this.server, () => (this.room?.mesh ? { frame: this.room.frame(), look: this.room.look() } : null), goTo);
    this.at("again").addEventListener("click", () => go({ scene: this.server.jobs.get(this.id).scene, like: this.id }));
    this.at("close").addEventListener("click", () => go({ [this.slot]: null }));
    this.at("log-details").addEventListener("toggle", () => this.showLog());
    this.at("beside").hidden = this.slot !== "job";
    this.at("beside").addEventListener("change", (event) => go({ with: event.target.value }));
    this.show();
    this.showOutputs();
    const past = await ask(`v1/jobs/${id}/events?after=0&follow=0`, { headers: { Accept: "application/x-ndjson" } });
    if (past.status !== 200) return;
    for (const line of (await past.text()).split("\n").filter(Boolean)) {
      const { event, data } = JSON.parse(line);
      if (event === "metric" && data.series === "loss" && id === this.id) this.curve.set(data.step, data.value);
    }
    this.drawCurve();
  }

  show() {
    const job = this.server.jobs.get(this.id);
    if (!this.root || !job) return;
    this.at("name").textContent = job.name;
    this.at("number").textContent = `Job ${job.id}`;
    const wanted = job.wanted === "run" || TERMINAL.includes(job.state) ? "" : `, to ${job.wanted}`;
    this.at("state").textContent = job.state + wanted;
    this.at("stage").textContent = job.state !== "running" ? "" :
      [job.stage, job.parts ? `${job.parts.done} of ${job.parts.count} parts` : "", job.eta_sec !== null ? `${duration(job.eta_sec)} left` : ""].filter(Boolean).join(", ");
    this.at("job-progress").value = job.state === "succeeded" ? 1 : job.progress;
    this.at("job-progress").hidden = TERMINAL.includes(job.state);
    this.at("reason").textContent = [job.reason, job.hint].filter(Boolean).join(". ");
    this.at("again").hidden = !job.scene || job.kind === "render" || this.server.me.role === "viewer";
    this.showActions(job);
    this.showFigures(job);
    this.mixer.show(job);
    this.roomRender?.update();
    const others = [...this.server.jobs.values()].filter((other) => other.id !== job.id).sort((a, b) => b.id - a.id);
    showEach(this.at("beside"), [{ id: "" }, ...others], (o) => o.id, () => element("option", null), (option, o) => {
      option.value = o.id;
      option.textContent = o.id === "" ? "side by side with…" : `${o.id}: ${o.name}`;
    });
  }

  showActions(job) {
    const { me } = this.server, mine = isOwn(me, job);
    const actions = mine ? [...ACTIONS[job.state] ?? []] : [];
    if (mine && !me.open) actions.push(job.shared ? "unshare" : "share");
    showEach(this.at("actions"), actions, (action) => action, (action) => element("button", action), (button, action) => {
      button.onclick = () => this.act(action.endsWith("share")
        ? () => send("PATCH", `v1/jobs/${job.id}`, { shared: !job.shared }, { "If-Match": "*" })
        : () => post(`v1/jobs/${job.id}/${action}`));
    });
  }

  async act(request) {
    await request().catch((problem) => { this.at("reason").textContent = problem.message; });
    this.server.refresh(this.id);
  }

  showFigures(job) {
    const report = this.report ?? {}, metrics = report.metrics ?? {}, segments = report.segments ?? [];
    const seconds = (report.stages ?? []).reduce((sum, stage) => sum + stage.seconds, 0);
    const seen = report.seen_surface_share;
    showFigures(this.at("figures"), [
      ["held-out views", ...verdictOf(metrics)],
      ["render of", job.kind === "render" && `job ${job.source}`],
      ["size", job.kind === "render" && job.settings?.size],
      ["paths a pixel", job.kind === "render" && job.settings?.spp],
      ["lamps", this.report && segments.filter((s) => s.emitter).length],
      ["segments", this.report && segments.length],
      ["surface seen", seen !== undefined && `${Math.round(100 * seen)} %`, "share of the surface that photographs show"],
      ["texture", report.prepare && `${report.prepare.texture_width} × ${report.prepare.texture_height}`],
      ["work", seconds > 0 && duration(seconds)],
      ["owner", job.owner],
      ["kept until", job.expires_at && new Date(job.expires_at).toLocaleDateString()],
      ...Object.entries(job.labels ?? {}),
    ].map(([term, value, title]) => [term, value === false ? null : value, title]));
  }

  // One look however many files arrive at once.
  showOutputsSoon() {
    if (this.isDue) return;
    this.isDue = true;
    setTimeout(() => {
      this.isDue = false;
      if (this.root) this.showOutputs();
    }, OUTPUTS_WAIT_MS);
  }

  // --- what it has made ----------------------------------------------------------------------

  async showOutputs() {
    const id = this.id, { items } = await get(`v1/jobs/${id}/outputs`);
    if (id !== this.id) return;
    await this.readReport(items.find((o) => o.name === "report.json"));
    if (id !== this.id) return;
    const job = this.server.jobs.get(id), compared = items.filter(isComparison);
    this.slider.show(compared, (this.report?.views ?? []).map((view) => view.name));
    const isDone = job?.kind === "render" && items.some(isRendered); // then what there was before is one of them
    this.at("pictures").classList.toggle("renders", job?.kind === "render");
    showThumbnails(this.at("pictures"), items.filter((o) => isThumbnail(o) && !isComparison(o) && !(isDone && o.name === "preview/render.png")));
    showEach(this.at("files"), items, (output) => output.name, makeFileRow, fillFileRow);
    const page = items.find((o) => o.name === "report.html");
    this.at("report").hidden = !page;
    if (page) this.at("report").href = page.href.slice(1);
    if (job) this.showFigures(job);
    await this.showRoom(job, items);
  }

  async readReport(output) {
    if (!output || this.reportVersion === output.sha256 + output.updated_at) return;
    this.reportVersion = output.sha256 + output.updated_at;
    this.report = await get(output.href.slice(1)).catch(() => null);
  }

  // three.js is loaded only where there is a room to show.
  async showRoom(job, items) {
    if (!job || !items.some((o) => o.name === "scene.ply")) return;
    if (!this.room) {
      const [{ Room }, { RoomRender }] = await Promise.all([import("./room.js"), import("./room_render.js")]);
      if (this.id !== job.id || this.room) return;
      this.room = new Room(this.at("room"), (started) => {
        this.server.jobs.set(started.id, started);
        goTo(started);
      });
      this.roomRender = new RoomRender(this.at("room"), this.room, this.server, goTo);
    }
    this.room.up = this.report?.up;
    await this.room.show(job, items, this.report?.segments ?? []);
    this.roomRender?.update();
  }

  addToCurve({ step, value }) {
    this.curve.set(step, value);
    this.drawCurve();
  }

  drawCurve() {
    const [svg, caption] = this.at("curve").children;
    this.at("curve").hidden = !drawCurve(svg, caption, this.curve);
  }

  async showLog() {
    if (!this.at("log-details").open) return;
    this.at("log").textContent = await (await ask(`v1/jobs/${this.id}/log?bytes=65536`)).text();
  }
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
