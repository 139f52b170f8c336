// upload.js -- sends a room by the tus protocol 1.0.0: in parts, going on where a broken connection or a closed page left
// off. Which upload belongs to which bundle is kept in the browser.

import { ask, get } from "./api.js";
import { bytes } from "./dom.js";

const PART_BYTES = 8 << 20;
const TRIES = 8, FIRST_WAIT_MS = 500;
const TUS = { "Tus-Resumable": "1.0.0" };

const key = ({ name, blob, stamp }) => `upload ${name} ${blob.size} ${stamp}`;
const wait = (ms) => new Promise((done) => setTimeout(done, ms));

function encoded(text) { // base64 of UTF-8
  return btoa(String.fromCharCode(...new TextEncoder().encode(text)));
}

async function begin(bundle) {
  const reply = await ask("v1/uploads", {
    method: "POST",
    headers: { ...TUS, "Upload-Length": String(bundle.blob.size), "Upload-Metadata": `name ${encoded(bundle.name)}` },
  });
  return new URL(reply.headers.get("Location"), location.href).pathname.slice(1).replace(/^.*(?=v1\/)/, "");
}

// The path of the upload, and how much of it the server has.
async function find(bundle) {
  const known = localStorage.getItem(key(bundle));
  if (known) {
    const reply = await fetch(known, { method: "HEAD", headers: TUS });
    const offset = Number(reply.headers.get("Upload-Offset") ?? NaN);
    if (reply.ok && offset <= bundle.blob.size) return { path: known, offset };
    if (reply.status < 500) localStorage.removeItem(key(bundle));
  }
  const path = await begin(bundle);
  localStorage.setItem(key(bundle), path);
  return { path, offset: 0 };
}

async function sendPart(path, bundle, offset) {
  const reply = await ask(path, {
    method: "PATCH",
    headers: { ...TUS, "Upload-Offset": String(offset), "Content-Type": "application/offset+octet-stream" },
    body: bundle.blob.slice(offset, offset + PART_BYTES),
  });
  return Number(reply.headers.get("Upload-Offset"));
}

// Whether it is worth trying again: the connection broke off, the server is busy, or it has got another offset.
const isPassing = ({ status }) => status === undefined || status === 409 || status === 423 || status === 429 || status >= 500 && status !== 507;

// The scene that the bundle became; tell(share, words) hears how it goes on.
export async function upload(bundle, tell) {
  const began = performance.now();
  let tries = 0, at = null, first = 0;
  for (;;) {
    try {
      if (!at) {
        at = await find(bundle);
        first = at.offset;
      }
      while (at.offset < bundle.blob.size) {
        at.offset = await sendPart(at.path, bundle, at.offset);
        tries = 0;
        const speed = 1000 * (at.offset - first) / (performance.now() - began);
        tell(at.offset / bundle.blob.size,
          `${bytes(at.offset)} of ${bytes(bundle.blob.size)} sent${first ? `, ${bytes(first)} of it earlier` : ""}; ${bytes(Math.round(speed))}/s`);
      }
      const { scene } = await get(at.path);
      if (scene) {
        localStorage.removeItem(key(bundle));
        return await get(`v1/scenes/${scene}`);
      }
      await wait(FIRST_WAIT_MS); // it is being unpacked
    } catch (problem) {
      if (!isPassing(problem) || ++tries > TRIES) throw problem;
      tell(at ? at.offset / bundle.blob.size : 0, `${problem.message}; trying again`);
      at = null;
      await wait(FIRST_WAIT_MS * 2 ** tries);
    }
  }
}
