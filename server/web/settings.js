// settings.js -- the settings of a job as a form, made from the server's table: those that everybody wants first, all
// others with their help behind a fold. What stays at its default is not sent. Settings of single segments
// ("emitters.27") have no field: they are carried along from the job that the form began with, and named.

import { element } from "./dom.js";
import { get } from "./api.js";

const FIRST = ["texture_size", "quality", "time_limit_sec"];
const SIZES = [512, 1024, 2048, 4096, 8192];

let table = null;
let carried = {}; // settings without a field

function input(setting) {
  const id = `setting-${setting.name}`;
  if (setting.type === "choice" || setting.type === "bool") {
    const select = element("select", null, { id });
    for (const word of setting.type === "bool" ? ["true", "false"] : setting.choices)
      select.append(element("option", word, { value: word }));
    select.value = String(setting.default);
    return select;
  }
  const field = element("input", null, { id, type: "text", placeholder: String(setting.default ?? "") });
  if (setting.type === "int" || setting.type === "real")
    Object.assign(field, { type: "number", min: setting.minimum, max: setting.maximum, step: setting.type === "int" ? 1 : "any" });
  if (setting.name === "texture_size") {
    const list = element("datalist", null, { id: "texture-sizes" });
    for (const size of SIZES) list.append(element("option", null, { value: size }));
    field.setAttribute("list", "texture-sizes");
    return [field, list];
  }
  return field;
}

function row(setting) {
  const line = element("div", null, { className: "setting" }), made = [input(setting)].flat();
  const unit = setting.unit ? ` (${setting.unit})` : "", name = setting.unit === "s" ? setting.name.replace(/_sec$/, "") : setting.name;
  line.append(element("label", name.replaceAll("_", " ") + unit, { htmlFor: made[0].id }), ...made,
    element("p", setting.help, { className: "quiet", id: `${made[0].id}-help` }));
  made[0].setAttribute("aria-describedby", `${made[0].id}-help`);
  return line;
}

// Fills `first` and `others`, once.
export async function showSettings(first, others) {
  if (table) return;
  table = (await get("v1/settings")).items;
  first.append(...FIRST.map((name) => table.find((s) => s.name === name)).filter(Boolean).map(row));
  others.append(...table.filter((s) => !FIRST.includes(s.name)).map(row));
}

const fieldOf = (form, setting) => form.querySelector(`#setting-${setting.name}`);

// Puts {texture_size: 2048, ...} into the form, and defaults into the other fields. Returns what has no field, in words.
export function useSettings(form, given) {
  carried = { ...given };
  for (const setting of table ?? []) {
    const field = fieldOf(form, setting);
    field.value = given[setting.name] ?? (field.tagName === "SELECT" ? setting.default : "");
    delete carried[setting.name];
  }
  return Object.entries(carried).map(([name, value]) => `${name} = ${value}`).join(", ");
}

// {texture_size: 2048, ...}: what was given.
export function givenSettings(form) {
  const given = { ...carried };
  for (const setting of table ?? []) {
    const text = fieldOf(form, setting).value.trim();
    if (text === "" || text === String(setting.default)) continue;
    given[setting.name] = setting.type === "bool" ? text === "true"
      : setting.type === "int" || setting.type === "real" ? Number(text) : text;
  }
  return given;
}
