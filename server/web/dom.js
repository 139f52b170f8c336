// dom.js -- elements of the page and words for figures. What comes from the server is put in as text, never as markup.

export const $ = (id) => document.getElementById(id);

export function element(name, text, attributes = {}) {
  const made = document.createElement(name);
  if (text !== null) made.textContent = text;
  return Object.assign(made, attributes);
}

// The children of `parent` are made to be one for each of `items`, in their order. A child whose key stays is changed
// in place, so that the focus, a selection and a button that is held down outlive an event.
export function showEach(parent, items, key, make, fill) {
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

// Terms and what they are, as the children of a <dl>; an item without a value is left out.
export function showFigures(list, items) {
  showEach(list, items.filter(([, value]) => value !== undefined && value !== null && value !== ""), ([term]) => term,
    () => {
      const pair = element("div", null);
      pair.append(element("dt", null), element("dd", null));
      return pair;
    },
    (pair, [term, value, title = ""]) => {
      pair.firstChild.textContent = term;
      pair.lastChild.textContent = value;
      pair.title = title;
    });
}

export const bytes = (n) =>
  n < 1024 ? `${n} B`
  : n < 2 ** 20 ? `${(n / 1024).toFixed(0)} KiB`
  : n < 2 ** 30 ? `${(n / 2 ** 20).toFixed(1)} MiB`
  : `${(n / 2 ** 30).toFixed(1)} GiB`;

export const duration = (s) =>
  s < 90 ? `${Math.round(s)} s` : s < 5400 ? `${Math.round(s / 60)} min` : `${(s / 3600).toFixed(1)} h`;

// Whether a job may be changed by who looks at it.
export const isOwn = (me, job) => me.role === "admin" || (me.role === "user" && job.owner === me.user);
