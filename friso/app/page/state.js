// The machines of the page: several in tabs, each with its history. All state lives here, and survives a server.
const STORE = "friso-machines";
const listeners = [];

export const state = { machines: [], shown: 0, pinned: null };

/** Be told of every change; `dragged` is true while a slider moves. */
export const onChange = (listener) => listeners.push(listener);

function changed(dragged = false) {
  if (!dragged) save();
  listeners.forEach((listener) => listener(dragged));
}

export const current = () => state.machines[state.shown];
export const changes = (machine = current()) => machine.steps[machine.step];
/** What is sent of a machine. */
export const sent = (machine = current()) => ({ name: machine.name, text: machine.text, changes: changes(machine) });
export const pinned = () => state.pinned;

export function add(name, text, given = {}) {
  state.machines.push({ name, text, steps: [given], step: 0 });
  state.shown = state.machines.length - 1;
  changed();
}

export function show(number) {
  state.shown = number;
  changed();
}

export function close(number) {
  state.machines.splice(number, 1);
  state.shown = Math.max(0, Math.min(state.shown - (number < state.shown ? 1 : 0), state.machines.length - 1));
  changed();
}

let drag = null;

/** Set keys; `dragged`: not yet for good. */
export function set(values, dragged = false) {
  const machine = current();
  const before = drag?.machine === machine ? drag.before : changes(machine);
  const next = { ...before, ...values };
  if (dragged) {
    if (!drag) {
      machine.steps.length = machine.step + 1;
      machine.steps.push(next);
      machine.step += 1;
      drag = { machine, before };
    }
    machine.steps[machine.step] = next;
  } else {
    if (drag?.machine === machine) machine.steps[machine.step] = next;
    else {
      machine.steps.length = machine.step + 1;
      machine.steps.push(next);
      machine.step += 1;
    }
    drag = null;
  }
  changed(dragged);
}

/** Take back the last step for good: what was refused. */
export function drop() {
  const machine = current();
  if (machine.step > 0) {
    machine.steps.splice(machine.step, 1);
    machine.step -= 1;
    drag = null;
    changed();
  }
}

export function go(step) {
  const machine = current();
  machine.step = Math.max(0, Math.min(step, machine.steps.length - 1));
  changed();
}

export function pin() {
  state.pinned = state.pinned ? null : structuredClone(sent());
  changed();
}

// ---------------------------------------------------------------- kept in the browser, and in a link

function save() {
  try {
    localStorage.setItem(STORE, JSON.stringify(state));
  } catch {
    // a browser that keeps nothing
  }
}

export function restore() {
  try {
    const kept = JSON.parse(localStorage.getItem(STORE));
    if (kept?.machines?.length) Object.assign(state, kept);
  } catch {
    // nothing is kept
  }
}

/** A link that holds the machine: behind #, which browsers send nowhere. */
export async function link() {
  const bytes = await through(new CompressionStream("deflate-raw"), new TextEncoder().encode(JSON.stringify(sent())));
  const text = btoa(Array.from(bytes, (byte) => String.fromCharCode(byte)).join(""));
  return `${location.origin}/#${text.replaceAll("+", "-").replaceAll("/", "_").replaceAll("=", "")}`;
}

export async function fromLink(hash) {
  if (!hash || hash === "#") return false;
  try {
    const text = atob(hash.slice(1).replaceAll("-", "+").replaceAll("_", "/"));
    const bytes = await through(new DecompressionStream("deflate-raw"), Uint8Array.from(text, (c) => c.charCodeAt(0)));
    const { name, text: toml, changes: given } = JSON.parse(new TextDecoder().decode(bytes));
    add(String(name), String(toml), given);
    return true;
  } catch {
    return false;
  }
}

const through = async (stream, bytes) =>
  new Uint8Array(await new Response(new Blob([bytes]).stream().pipeThrough(stream)).arrayBuffer());
