// users.js -- for admins: who there is, what they keep and have used, and their tokens, which are made and revoked here.

import { $, bytes, element, showEach } from "./dom.js";
import { get, post, send } from "./api.js";

const DAY_MS = 86400000;
const day = (text) => (text ? new Date(text).toLocaleDateString() : "never");
const hours = (sec) => `${(sec / 3600).toFixed(1)} h`;

function makeRow(columns) {
  const row = element("tr", null);
  for (let i = 0; i < columns; i++) row.append(element("td", null));
  return row;
}

function fillUser(row, user) {
  const limit = user.kept_bytes_max ? ` of ${bytes(user.kept_bytes_max)}` : "";
  const words = [user.name, `${user.open_jobs} open, ${user.jobs} in all`, bytes(user.kept_bytes) + limit,
    `${hours(user.cpu_sec_month)} this month, ${hours(user.cpu_sec)} in all`];
  words.forEach((text, i) => { row.children[i].textContent = text; });
  row.lastElementChild.title = user.month ? `this month: ${user.month}` : "";
}

function fillToken(row, token) {
  const [number, user, role, made, ends, revoke] = row.children;
  number.textContent = token.id;
  user.textContent = token.user;
  role.textContent = token.role;
  made.textContent = day(token.created_at);
  ends.textContent = day(token.expires_at) + (token.expired ? ", is past" : "");
  ends.className = token.expired ? "bad" : "";
  if (!revoke.firstChild) revoke.append(element("button", "Revoke", { type: "button" }));
  revoke.firstChild.ariaLabel = `revoke token ${token.id} of ${token.user}`;
  revoke.firstChild.onclick = () => act(() => send("DELETE", `v1/tokens/${token.id}`));
}

async function show() {
  const [users, tokens] = await Promise.all([get("v1/users"), get("v1/tokens")]);
  showEach($("users"), users.items, (user) => user.name, () => makeRow(4), fillUser);
  showEach($("tokens"), tokens.items, (token) => token.id, () => makeRow(6), fillToken);
  showEach($("known-users"), users.items, (user) => user.name, () => element("option", null), (option, { name }) => { option.value = name; });
}

async function act(request) {
  $("people-problem").textContent = "";
  await request().then(show).catch((problem) => { $("people-problem").textContent = problem.message; });
}

$("people").addEventListener("toggle", () => { if ($("people").open) act(async () => {}); });

$("add-token").addEventListener("submit", (event) => {
  event.preventDefault();
  const days = Number($("token-days").value), expires_at = days > 0 ? new Date(Date.now() + days * DAY_MS).toISOString() : null;
  $("new-token").hidden = true;
  act(async () => {
    const made = await (await post("v1/tokens", { user: $("token-user").value.trim(), role: $("token-role").value, expires_at })).json();
    $("new-token").hidden = false;
    $("new-token-words").textContent = `Token ${made.id} of ${made.user}, shown once:`;
    $("new-token-text").value = made.token;
    $("new-token-text").select();
  });
});

// me: {role, open}: there is nothing to see for others, and no users where the daemon lets everybody in
export function showUsers(me) {
  $("people").hidden = me.role !== "admin" || me.open;
  if ($("people").hidden) $("people").open = false;
}

export function forgetUsers() {
  for (const id of ["users", "tokens"]) $(id).replaceChildren();
  $("new-token").hidden = true;
  $("new-token-text").value = "";
  $("people").open = false;
}
