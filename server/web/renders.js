// renders.js -- renders of a reconstruction that the page asks for: small ones that run beside the large jobs, and others.

import { ask, get, post } from "./api.js";

const CAMERA = "view.json"; // the file that holds the camera of a render from elsewhere than a photograph's place
const LANE_SPP = [64, 32, 16, 8, 4];

export const isBusy = (job) => ["queued", "running", "paused"].includes(job?.state);
export const isPerLight = (job) => job.kind === "render" && job.settings?.per_light === true;

// Starts a render of the job `source`. frame: a camera as transforms.json has it; null: settings say where from.
export async function startRender(source, name, settings, frame = null) {
  const all = frame ? { ...settings, cameras: CAMERA, view: "0" } : settings;
  const job = await (await post("v1/jobs", { kind: "render", source, name: name.slice(0, 200), settings: all })).json();
  if (!frame) return job;
  try {
    await ask(`v1/jobs/${job.id}/files/${CAMERA}`,
      { method: "PUT", headers: { "Content-Type": "application/octet-stream" }, body: JSON.stringify({ frames: [frame] }) });
  } catch (problem) { // it would wait for its camera for ever
    await post(`v1/jobs/${job.id}/cancel`).catch(() => {});
    throw problem;
  }
  return get(`v1/jobs/${job.id}`);
}

// The settings with as many paths as a render in the lane of small ones may have.
export async function inLane(source, settings, frame = null) {
  const cameras = frame ? { cameras: CAMERA, view: "0" } : {};
  for (const spp of LANE_SPP) {
    const all = { ...settings, spp };
    const { small } = await (await post("v1/jobs?dry_run=1", { kind: "render", source, settings: { ...all, ...cameras } })).json();
    if (small) return all;
  }
  return { ...settings, spp: LANE_SPP.at(-1) };
}

// Whether a render needs files that the page does not have: all but the camera that it sent itself.
export const hasOtherFiles = (job) => (job.files ?? []).some(({ name }) => name !== CAMERA);
export const hasOwnCamera = (job) => job.settings?.cameras === CAMERA;

// "640x480": a frame's picture so many pixels wide.
export const sizeOf = ({ w, h }, width) => `${width}x${Math.max(1, Math.round(h * width / w))}`;
