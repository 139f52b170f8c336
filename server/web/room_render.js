// room_render.js -- renders from where the room is looked at, without what is hidden there: a small one at once, and that
// same view large on wish.

import { get, load } from "./api.js";
import { inLane, isBusy, sizeOf, startRender } from "./renders.js";

const SMALL_WIDTH = 320, LARGE_SPP = 256;

export class RoomRender {
  // room: of room.js; server: {me, jobs}; whenStarted is told of a large render
  constructor(root, room, server, whenStarted) {
    Object.assign(this, { root, room, server, whenStarted });
    this.at = (name) => root.querySelector(`.view-${name}`);
    this.at("small").addEventListener("click", () => this.press(() => this.small()));
    this.at("large").addEventListener("click", () => this.press(() => this.large()));
  }

  async press(action) {
    this.at("small").disabled = this.at("large").disabled = true;
    this.at("state").textContent = "";
    await action().catch((problem) => { this.at("state").textContent = problem.message; });
    this.at("small").disabled = this.at("large").disabled = false;
  }

  get job() { return this.room.job; }

  async small() {
    const hidden = this.room.hidden();
    this.frame = this.room.frame();
    this.as = { ...this.room.look(), ...(hidden.length > 0 ? { remove: hidden.join(",") } : {}) };
    this.about = hidden.length > 0 ? `, without what is hidden (${hidden.length})`
      : this.room.isOutside && !this.as.look_in ? ". From outside one sees the backs of walls: look in from outside, or walk through the room" : "";
    const settings = await inLane(this.job.id, { size: sizeOf(this.frame, SMALL_WIDTH), ...this.as }, this.frame);
    this.render = await startRender(this.job.id, `${this.job.name}, a look`, settings, this.frame);
    this.server.jobs.set(this.render.id, this.render);
    this.update();
  }

  async large() {
    const { w, h } = this.frame;
    const job = await startRender(this.job.id, `${this.job.name}, a view`, { size: `${w}x${h}`, spp: LARGE_SPP, ...this.as },
      this.frame);
    this.server.jobs.set(job.id, job);
    this.whenStarted(job);
  }

  // Whenever any job changes.
  async update() {
    const { me, jobs } = this.server, job = this.render && jobs.get(this.render.id);
    this.at("bar").hidden = me.role === "viewer" || jobs.get(this.job?.id)?.state !== "succeeded"; // what runs changes
    this.at("progress").hidden = !isBusy(job);
    if (!job || this.isShown === job.id) return;
    if (isBusy(job)) {
      this.at("progress").value = job.progress;
      this.at("state").textContent = `Job ${job.id} is ${job.state}.`;
      return;
    }
    this.isShown = job.id;
    this.at("state").textContent = job.state === "succeeded" ? "" : [job.reason || job.state, job.hint].filter(Boolean).join(". ");
    if (job.state !== "succeeded") return;
    const { items } = await get(`v1/jobs/${job.id}/outputs`), picture = items.find((o) => /_radiance\.png$/.test(o.name));
    if (!picture || this.isShown !== job.id) return;
    await load(this.at("image"), picture.href.slice(1));
    this.at("figure").hidden = false;
    this.at("caption").textContent = `Job ${job.id}: ${job.settings.size}, ${job.settings.spp} paths a pixel${this.about}.`;
  }
}
