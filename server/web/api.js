// api.js -- requests to the server. The token is in a cookie that no script can read; every request simply carries it.

const EXPIRED = "urn:unbake:token-expired";

let whenSignedOut = () => {}; // hears why, "" where there is nothing to say
export function onSignedOut(callback) { whenSignedOut = callback; }

// The reply; an Error with the problem's words, its hint and its status where the server refuses.
export async function ask(path, options = {}) {
  const reply = await fetch(path, options);
  if (reply.status === 401) {
    const { type, detail } = await reply.json().catch(() => ({}));
    whenSignedOut(type === EXPIRED ? `${detail}.` : ""); // others have nothing to tell: nobody was signed in
    throw Object.assign(new Error("a token is needed"), { status: 401 });
  }
  if (!reply.ok) {
    const problem = await reply.json().catch(() => ({}));
    const params = (problem.invalid_params ?? []).map((p) => [`${p.name} ${p.reason}`, p.hint].filter(Boolean).join(": "));
    const text = [problem.detail ?? `${path}: ${reply.status}`, params.join("; "), problem.hint].filter(Boolean).join(". ");
    throw Object.assign(new Error(text), { status: reply.status });
  }
  return reply;
}

export const get = async (path) => (await ask(path)).json();

export const send = (method, path, body, fields = {}) => ask(path, {
  method,
  headers: body === undefined ? fields : { "Content-Type": "application/json", ...fields },
  body: body === undefined ? undefined : JSON.stringify(body),
});
export const post = (path, body) => send("POST", path, body);

// By fetch, since an image whose URL stays the same is not loaded again when its content changes.
export async function load(image, path) {
  const reply = await ask(path).catch(() => null); // it may be replaced just now: the next event tells
  if (!reply) return;
  const url = URL.createObjectURL(await reply.blob());
  await new Promise((done) => {
    image.onload = image.onerror = done;
    URL.revokeObjectURL(image.src);
    image.src = url;
  });
}
