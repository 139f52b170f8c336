// address.js -- what is looked at is in the address, after #: a reload, a bookmark and the back button keep it.
//
//   job: the number of the job that is looked at; with: of the one beside it; scene: the room whose check is shown;
//   like: the job whose settings a new one on that room begins with; q, state: what the list shows

const listeners = new Set();

export const place = () => Object.fromEntries(new URLSearchParams(location.hash.slice(1)));

// Changes some of it; null takes a part out. A step in the history unless `isTyping`.
export function go(change, isTyping = false) {
  const parts = new URLSearchParams(location.hash.slice(1));
  for (const [name, value] of Object.entries(change)) {
    if (value === null || value === "") parts.delete(name);
    else parts.set(name, value);
  }
  const hash = `#${parts}`;
  if (hash === (location.hash || "#")) return;
  history[isTyping ? "replaceState" : "pushState"](null, "", hash);
  for (const listener of listeners) listener();
}

export function onMove(listener) {
  listeners.add(listener);
}

for (const type of ["popstate", "hashchange"])
  addEventListener(type, () => { for (const listener of listeners) listener(); });
