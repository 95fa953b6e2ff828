// The machines of the page: several in tabs, each with its history. All state lives here, and survives a server.
// Tabs of the browser keep theirs each; a new one begins with what was kept last.
import { token } from "./dom.js";

const STORE = "friso-machines-";
const MOST_KEPT = 10;
const MOST_STEPS = 200;
const listeners = [];
const keeping = [];

export const state = { machines: [], shown: 0, pinned: null };

/** Be told of every change; `dragged` is true while a slider moves. */
export const onChange = (listener) => listeners.push(listener);

/** Be told with every change why the browser does not keep it, "" where it does. */
export const onKept = (listener) => keeping.push(listener);

function changed(dragged = false) {
  if (!dragged) save();
  listeners.forEach((listener) => listener(dragged));
}

export const current = () => state.machines[state.shown];
export const changes = (machine = current()) => machine.steps[machine.step];
/** What is sent of a machine. */
export const sent = (machine = current()) => ({ name: machine.name, text: machine.text, made: machine.made, changes: changes(machine) });
export const pinned = () => state.pinned;

/** Add a machine; `made`: on the page, there is no file of it, and it has a name that no other one here has. */
export function add(name, text, made = false, given = {}) {
  drag = null;
  state.machines.push({ name: made ? free(name) : name, text, made, steps: [given], step: 0 });
  state.shown = state.machines.length - 1;
  changed();
}

/** A name for a stage file that no machine of the page has: with a number, unless it is free. */
function free(name) {
  const stem = name.replace(/(_\d+)?\.toml$/, "");
  const names = state.machines.map((machine) => machine.name);
  for (let number = 2, wanted = name; ; number += 1) {
    if (!names.includes(wanted)) return wanted;
    wanted = `${stem}_${number}.toml`;
  }
}

export function show(number) {
  drag = null;
  state.shown = number;
  changed();
}

export function close(number) {
  drag = null;
  state.machines.splice(number, 1);
  state.shown = Math.max(0, Math.min(state.shown - (number < state.shown ? 1 : 0), state.machines.length - 1));
  changed();
}

/** While a slider is held: the keys before, and whether it has moved; until it is let go, all is one step. */
let drag = null;

export const dragging = () => drag !== null;

/** A slider is taken hold of. */
export function hold() {
  drag ??= { before: changes(), moved: false };
}

/** It is let go, wherever that is. */
export function release() {
  if (!drag) return;
  drag = null;
  changed();
}

/** Set keys; `dragged`: not yet for good. */
export function set(values, dragged = false) {
  const machine = current();
  if (dragged) hold();
  const next = { ...(drag?.before ?? changes(machine)), ...values };
  if (drag?.moved) machine.steps[machine.step] = next;
  else append(machine, next);
  if (dragged) drag.moved = true;
  else drag = null;
  changed(dragged);
}

function append(machine, next) {
  machine.steps.length = machine.step + 1;
  machine.steps.push(next);
  machine.steps.splice(0, machine.steps.length - MOST_STEPS);
  machine.step = machine.steps.length - 1;
  machine.cured = null;
}

/** Show a machine as it was when no more than these keys were `given`; one that was closed is opened again. */
export function back(machine, given) {
  const number = state.machines.indexOf(machine);
  if (number < 0) return add(machine.name, machine.text, machine.made, given);
  drag = null;
  append(machine, given);
  state.shown = number;
  changed();
}

export function go(step) {
  drag = null;
  const machine = current();
  machine.step = Math.max(0, Math.min(step, machine.steps.length - 1));
  changed();
}

/** Set keys as a button says; `label` is what that is called until they are changed again. */
export function cure(label, values) {
  set(values);
  current().cured = { step: current().step, label };
  changed();
}

/** What the last change is called if it came of a button, else null. */
export const cured = () => (current().cured?.step === current().step ? current().cured.label : null);

export function pin() {
  state.pinned = state.pinned ? null : structuredClone(sent());
  changed();
}

// ---------------------------------------------------------------- kept in the browser, and in a link

const FULL = "What you change now is lost when this page is closed: the storage of the browser is full. Save the stage files under Out, or close machines.";
const NONE = "What is on this page is lost when it is closed: the browser keeps nothing for it. Save the stage files under Out.";

function save() {
  let said = "";
  try {
    sessionStorage.friso ??= token();
    put(own(), JSON.stringify({ ...state, at: Date.now() }));
  } catch (error) {
    said = error.name === "QuotaExceededError" ? FULL : NONE;
  }
  keeping.forEach((listener) => listener(said));
}

const own = () => STORE + sessionStorage.friso;

/** What the tabs of the browser kept, the last first, with the texts of the stores. */
function stores() {
  const names = Object.keys(localStorage).filter((name) => name.startsWith(STORE));
  const all = names.map((name) => ({ name, text: localStorage.getItem(name) })).map((store) => ({ ...store, kept: parsed(store.text) }));
  return all.sort((one, other) => (other.kept.at ?? 0) - (one.kept.at ?? 0));
}

function parsed(text) {
  try {
    return JSON.parse(text) ?? {};
  } catch {
    return {};
  }
}

/** Keep a text. Where there is no room, what other tabs kept goes, the oldest first, unless even that is not enough. */
function put(name, text) {
  const gone = [];
  const others = [];
  for (;;) {
    try {
      localStorage.setItem(name, text);
      return;
    } catch (error) {
      if (!gone.length) others.push(...stores().filter((store) => store.name !== name));
      if (!others.length) {
        gone.reverse().forEach((store) => localStorage.setItem(store.name, store.text));
        throw error;
      }
      gone.push(others.pop());
      localStorage.removeItem(gone.at(-1).name);
    }
  }
}

export function restore() {
  try {
    const all = stores();
    for (const { name } of all.slice(MOST_KEPT)) localStorage.removeItem(name);
    const mine = all.find(({ name }) => name === own());
    const { machines, shown, pinned: kept } = (mine ?? all[0])?.kept ?? {};
    if (!machines?.length || !machines.every(isMachine)) return;
    Object.assign(state, { machines, pinned: kept, shown: machines[shown] ? shown : 0 });
    if (mine) save();
  } catch {
    // nothing is kept
  }
}

/** A tab that is opened from another one, or is a copy of it, begins with its mark, and keeps what it has under it: the other one, which
 * sees that, takes another mark. */
window.addEventListener("storage", ({ key, newValue }) => {
  if (newValue === null || key !== own()) return;
  sessionStorage.friso = token();
  save();
});

const isChanges = (value) => value !== null && typeof value === "object" && !Array.isArray(value) && Object.values(value).every((item) => item === null || typeof item !== "object" || (Array.isArray(item) && item.every(Number.isFinite)));
const isMachine = ({ name, text, steps, step }) => typeof name === "string" && typeof text === "string" && steps.every(isChanges) && isChanges(steps[step]);

/** A link that holds the machine: behind #, which browsers send nowhere. */
export async function link(of = sent()) {
  const bytes = await through(new CompressionStream("deflate-raw"), new TextEncoder().encode(JSON.stringify(of)));
  const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return `${location.origin}/#${text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

export async function fromLink(hash) {
  if (!hash || hash === "#") return false;
  try {
    const text = atob(hash.slice(1).replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = await through(new DecompressionStream("deflate-raw"), Uint8Array.from(text, (c) => c.charCodeAt(0)));
    const { name, text: toml, changes: given } = JSON.parse(new TextDecoder().decode(bytes));
    if (typeof toml !== "string" || !isChanges(given ?? {})) return false;
    add(String(name), toml, true, given ?? {});
    return true;
  } catch {
    return false;
  }
}

const through = async (stream, bytes) =>
  new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());
