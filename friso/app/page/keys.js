// The keys of a part: value, unit, slider, meaning, uncertainty; and the stage file as text.
import { $, anew, dialog, el, words } from "./dom.js";
import { PARTS } from "./drawing.js";

const BARE = /^\s*[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?\s*$/i;
const QUANTITY = /^\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?)\s*(\S.*)?$/i;
const STEPS = 1000;
const SLIDER = "-slider";
const ranges = new Map();

/** A value as it is written: its unit, and how large that is in SI; of an uncertain one, whose centre is used, in SI. */
function written(key) {
  const parts = key.plain ? QUANTITY.exec(String(key.value)) : null;
  const number = Number(parts?.[1]);
  return number ? { unit: parts[2] ?? "", factor: key.si / number } : { unit: key.unit ?? "", factor: 1 };
}

/** A value [SI] of a key in the unit in which it is written. */
export function worded(key, si, digits = 6) {
  const { unit, factor } = written(key);
  const number = Number((si / factor).toPrecision(digits));
  return typeof key.value === "number" ? number : `${number} ${unit}`.trim();
}

/** A text in which a bare number has a unit: the one that is shown. */
export const withUnit = (text, unit) => (unit && BARE.test(text) ? `${text.trim()} ${unit}` : text.trim());

/** The unit that is shown at a key: as it is written, or that of its example. */
export const unitOf = (key) => (key.plain && key.value != null && QUANTITY.exec(String(key.value))?.[2]) || (QUANTITY.exec(String(key.example))?.[2] ?? key.unit ?? "");

/** Where sliders go is settled when a machine is opened: they do not move under the hand. */
export const forgetRanges = () => ranges.clear();

/** Whether a value is typed that has not been handed over yet. */
export function typing() {
  const field = document.activeElement;
  return Boolean(field?.matches?.("#keys input[type=text]")) && field.value !== field.defaultValue;
}

/** The keys of a part; where a slider had the focus and is gone, its field has it. */
export function keys(place, ...what) {
  anew(place, () => drawn(place, ...what), (slider) => $(slider.id.replace(SLIDER, "")));
}

function drawn(place, machine, part, changed, wrong, tell) {
  const about = PARTS.find((item) => item.id === part);
  const opened = new Set([...place.querySelectorAll("details[open]")].map((item) => item.dataset.table));
  const tables = about.tables.map((name) => machine.tables.find((table) => table.name === name));
  const text = el("button", { id: "keys-text", type: "button", class: "plain", onclick: () => tell.edit() }, "Edit as text");
  place.replaceChildren(el("h2", {}, about.label));
  for (const table of tables) {
    if (!table.present) {
      if (tables.filter((item) => item.present).length === 0 || table === tables[0]) {
        place.append(el("p", { class: "about" }, `[${table.name}] is not in the stage file. ${table.description}`));
      }
      continue;
    }
    place.append(el("p", { class: "about" }, `[${table.name}] ${table.description}`));
    const rows = table.keys.map((key) => [key, row(key, machine, changed, tell)]);
    place.append(...rows.filter(([key]) => key.value !== undefined && key.value !== null).map(([, item]) => item));
    const more = rows.filter(([key]) => key.value === undefined || key.value === null).map(([, item]) => item);
    if (more.length) {
      const summary = el("summary", { id: `keys-${table.name}` }, `${more.length} more keys of [${table.name}]`);
      place.append(el("details", { class: "more", "data-table": table.name, open: opened.has(table.name) }, summary, ...more));
    }
  }
  place.append(text);
  refuse(place, wrong);
}

/** Say what is wrong at its keys, and of no other one; they are not drawn again. */
export function refuse(place, wrong) {
  place.querySelectorAll(".wrong").forEach((item) => item.remove());
  for (const item of place.querySelectorAll("[data-path]")) {
    if (!wrong?.keys.includes(item.dataset.path)) continue;
    item.append(el("p", { class: "wrong", role: "alert" }, wrong.text));
    item.closest("details")?.toggleAttribute("open", true);
  }
}

/** A key as it was set last, which the server may not have read yet, or may have refused. */
function row(key, machine, changed, tell) {
  const value = key.path in changed ? changed[key.path] : key.value;
  const id = `key-${key.path.replaceAll(".", "-")}`;
  const label = el("label", { for: id, title: key.description }, words(key.path));
  const classes = `key${key.path in changed ? " changed" : ""}`;
  const item = el("div", { class: classes, "data-path": key.path }, label);
  if (key.kind === "switch") {
    item.append(el("input", { id, type: "checkbox", checked: value === true, onchange: (event) => tell.set(key.path, event.target.checked) }));
  } else if (key.kind === "word") {
    const options = key.options.map((word) => el("option", { value: word, selected: word === value }, word));
    if (value === undefined || value === null) options.unshift(el("option", { value: "", selected: true }, "–"));
    item.append(el("select", { id, onchange: (event) => event.target.value && tell.set(key.path, event.target.value) }, ...options));
  } else if (key.kind === "controller") {
    const options = key.options.map((name) => el("option", { value: name, selected: name === key.own }, name));
    item.append(el("select", { id, onchange: (event) => tell.controller(event.target.value) }, ...options));
  } else if (key.kind === "array") {
    item.append(el("button", { id, type: "button", onclick: () => tell.edit() }, "In the text"));
  } else {
    item.append(...field(key, value, id, tell));
  }
  if (machine.uncertain.includes(key.path)) item.append(el("span", { class: "uncertain" }, "uncertain: its centre is used"));
  item.append(el("span", { class: "help", id: `${id}-help` }, key.description));
  return item;
}

function field(key, value, id, tell) {
  const read = (text) => (text.trim() === "" ? null : !key.unit && Number.isFinite(Number(text)) ? Number(text) : withUnit(text, key.unit && unitOf(key)));
  const input = el("input", { id, type: "text", value: String(value ?? ""), placeholder: `e.g. ${key.example}`, autocomplete: "off", spellcheck: "false", "aria-describedby": `${id}-help` });
  input.addEventListener("change", () => {
    const value = read(input.value);
    input.value = input.defaultValue = String(value ?? ""); // handed over
    tell.set(key.path, value);
  });
  if (!key.plain || !key.range || !QUANTITY.test(String(key.value))) return [input];
  if (!ranges.has(key.path) || !inside(ranges.get(key.path), key.si)) ranges.set(key.path, key.range);
  const range = ranges.get(key.path);
  const slider = el("input", { id: id + SLIDER, "data-track": key.path, type: "range", min: 0, max: STEPS, value: place(range, key.si), "aria-label": `${words(key.path)}, slider` });
  slider.addEventListener("pointerdown", tell.hold);
  slider.addEventListener("input", () => {
    const moved = worded(key, at(range, slider.value), 4);
    input.value = input.defaultValue = moved; // handed over
    tell.set(key.path, moved, true);
  });
  slider.addEventListener("change", tell.release);
  return [input, slider];
}

const TRACK = 11; // values along a track
const COLOURS = { hunts: "#d55e00", bistable: "#d55e00", transient: "#e69f00", settles: "#009e73" };

/** The values [SI] along the tracks of the sliders that are there, by key. */
export const alongTracks = () => Object.fromEntries([...document.querySelectorAll("[data-track]")].map(({ dataset }) => [dataset.track, Array.from({ length: TRACK }, (_, k) => at(ranges.get(dataset.track), (STEPS * k) / (TRACK - 1)))]));

/** Colour the tracks by the verdicts along them; grey where there is none. */
export function colourTracks(tracks) {
  for (const slider of document.querySelectorAll("[data-track]")) {
    const verdicts = tracks[slider.dataset.track] ?? [];
    const ends = verdicts.map((_, k) => [k - 0.5, k + 0.5].map((place) => `${(100 * Math.max(0, Math.min(1, place / (TRACK - 1)))).toFixed(1)}%`).join(" "));
    const stops = verdicts.map((verdict, k) => `${COLOURS[verdict] ?? "var(--line)"} ${ends[k]}`);
    slider.style.setProperty("--track", stops.length ? `linear-gradient(to right, ${stops.join(", ")})` : "");
    slider.title = stops.length ? `Along it: ${verdicts.filter((word, k) => word !== verdicts[k - 1]).join(", ")}` : "";
  }
}

const inside = (range, si) => si >= range.low && si <= range.high;
const place = ({ low, high, log }, si) => Math.round(STEPS * (log ? Math.log(si / low) / Math.log(high / low) : (si - low) / (high - low || 1)));
const at = ({ low, high, log }, step) => (log ? low * (high / low) ** (step / STEPS) : low + ((high - low) * step) / STEPS);

/** The stage file as text; `take` is called with what it became. */
export function edit(toml, take) {
  const area = el("textarea", { rows: 24, cols: 80, spellcheck: "false", "aria-label": "Stage file" });
  area.value = toml;
  area.style.cssText = "width: 100%; font: 13px/1.4 ui-monospace, monospace; background: var(--panel); color: inherit; border: 1px solid var(--line)";
  const use = el("button", { type: "button" }, "Use this text");
  const box = dialog("The stage file", area, el("div", { class: "row" }, use));
  use.addEventListener("click", () => {
    box.close();
    take(area.value);
  });
}
