// The page: connects the machine, its keys, the answer and the pictures.
import * as answers from "./answer.js";
import { $, el } from "./dom.js";
import { drawing } from "./drawing.js";
import { edit, forgetRanges, keys } from "./keys.js";
import { out, save } from "./out.js";
import { Pictures } from "./pictures.js";
import * as machines from "./state.js";
import { tour } from "./tour.js";
import { ask, end, Live, onReach } from "./wire.js";

const CHECKED_AFTER = 500;
let shown = null; // the machine as the server describes it
let chosen = "controller";
let wrong = null;
let answer = null;
let timer = 0;
let held = "";

const sent = () => ({ machine: machines.sent(), pinned: machines.pinned() });
const set = (values, dragged = false) => machines.set(values, dragged);

const pictures = new Pictures(sent, {
  set: (values) => set(withUnits(values)),
  progress: answers.progress,
  shown: (part) => (answer = part),
  take: (name, toml) => machines.add(`${name.replaceAll(" ", "_")}.toml`, toml),
  check,
});

const form = new Live("machine", "machine", 2000, described);
const verdict = new Live("verdict", "verdict", 5000, (part, tag) => {
  if (part.kind === "message") return answers.progress(part);
  if (part.kind !== "answer") return;
  answers.quick(part);
  if (tag) answers.note(part.verdict, tag.changes, tag.label, (changes) => set(changes));
});

function withUnits(values) {
  const all = shown.tables.flatMap((table) => table.keys);
  return Object.fromEntries(
    Object.entries(values).map(([path, si]) => {
      const key = all.find((item) => item.path === path);
      const [, number, unit] = /^\s*(\S+)\s+(.*)$/.exec(key.value) ?? [];
      const factor = Number(number) ? key.si / Number(number) : 1;
      return [path, Number(number) ? `${Number((si / factor).toPrecision(6))} ${unit}` : `${si} ${key.unit}`];
    }),
  );
}

function changed(dragged) {
  bar();
  const machine = machines.current();
  if (!machine) return;
  clearTimeout(timer);
  end("check");
  answers.progress(null);
  if (shown && held === machine.text && !wrong) {
    follow(dragged);
    if (dragged) return;
  }
  form.ask({ machine: machines.sent() });
}

/** Verdict and picture follow the machine. */
function follow(dragged) {
  const given = machines.changes();
  const label = Object.entries(given).at(-1)?.join(" ") ?? "as opened";
  verdict.ask({ machine: machines.sent() }, { changes: given, label });
  pictures.changed(dragged);
}

/** The server has read the machine, or refused it. */
function described(part) {
  if (part.kind === "refused" || part.kind === "failed") {
    wrong = { keys: part.key.split(", "), text: part.text };
    end("check");
    answers.progress(null);
    if (!shown) return answers.refused(part.text);
    const known = shown.tables.flatMap((table) => table.keys).some((key) => wrong.keys.includes(key.path));
    left();
    if (!known) answers.refused(part.text);
    return;
  }
  if (part.kind !== "answer") return;
  const first = wrong !== null || held !== machines.current().text;
  wrong = null;
  shown = part;
  if (held !== machines.current().text) {
    held = machines.current().text;
    forgetRanges();
  }
  document.title = `${part.title || machines.current().name}: friso`;
  left();
  pictures.machine = part;
  pictures.bar();
  if (first) follow(false);
  clearTimeout(timer);
  timer = setTimeout(check, CHECKED_AFTER);
}

async function check() {
  const part = await ask("check", { ...pictures.body(), ...sent() }, "check", (item) => item.kind !== "answer" && answers.progress(item));
  if (!part) return;
  answers.progress(null);
  if (part.kind !== "answer") return answers.refused(part.text);
  verdict.stop();
  answers.whole(part);
  answer ??= part;
  pictures.checked(part);
}

function redraw() {
  const focused = document.activeElement?.dataset?.part;
  $("drawing").replaceChildren(drawing(shown, chosen, choose, (locked) => set({ "joint.locked": locked })));
  if (focused) $("drawing").querySelector(`[data-part="${focused}"]`)?.focus();
}

function left() {
  redraw();
  keys($("keys"), shown, chosen, machines.changes(), wrong, {
    set: (path, value, dragged = false) => set({ [path]: value }, dragged),
    edit: () => edit(shown.toml, (text) => machines.add(machines.current().name, text)),
  });
}

function choose(part) {
  chosen = part;
  left();
}

function bar() {
  const { state } = machines;
  const current = machines.current();
  $("machines").replaceChildren(
    ...state.machines.flatMap((machine, k) => [
      el("button", { type: "button", role: "tab", "aria-selected": String(k === state.shown), "aria-controls": "left", onclick: () => machines.show(k) }, machine.name.replace(/\.toml$/, "")),
      state.machines.length > 1 ? el("button", { type: "button", class: "close", role: "tab", "aria-selected": "false", "aria-label": `Close ${machine.name}`, title: "Close", onclick: () => machines.close(k) }, "×") : null,
    ].filter(Boolean)),
  );
  $("undo").disabled = !current || current.step === 0;
  $("redo").disabled = !current || current.step === current.steps.length - 1;
  $("pin").setAttribute("aria-pressed", String(Boolean(state.pinned)));
  $("pin").textContent = state.pinned ? "Unpin" : "Pin";
}

const undo = () => machines.go(machines.current().step - 1);
const redo = () => machines.go(machines.current().step + 1);

async function opened(file) {
  if (file.name.endsWith(".toml") && file.size < 4e6) machines.add(file.name, await file.text());
  else {
    pictures.show("logs");
    pictures.own.logs.add([file]);
  }
}

function trouble(text) {
  $("trouble").textContent = text;
  $("trouble").hidden = !text;
}

function wire() {
  $("undo").addEventListener("click", undo);
  $("redo").addEventListener("click", redo);
  $("pin").addEventListener("click", () => machines.pin());
  $("open").addEventListener("click", () => $("file").click());
  $("file").addEventListener("change", () => [...$("file").files].forEach(opened));
  $("tour").addEventListener("click", () => tour());
  $("out").addEventListener("click", () => out({ machine: { name: machines.current().name, toml: shown.toml }, answer, link: machines.link, files: report }));
  document.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.("input[type=text], textarea, select");
    if (typing) return;
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
      event.preventDefault();
      if (event.shiftKey) redo();
      else undo();
    } else if (event.key === "p" && !event.ctrlKey && !event.metaKey) machines.pin();
  });
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    trouble("");
    [...event.dataTransfer.files].forEach(opened);
  });
  onReach((there, text) => {
    trouble(there ? "" : text);
    if (there) changed(false);
  });
  machines.onChange(changed);
}

/** Ask for what the command would write, and save it; resolves to what to say. */
async function report(part) {
  const question = ["bode", "map", "boundary", "flexure"].includes(pictures.shown) ? pictures.shown : "check";
  const options = pictures.form ? pictures.form() : {};
  const made = await ask(`${question}.zip`, { ...pictures.body(options), ...sent() }, "report", part);
  if (!made || made.kind !== "files") return made?.text;
  save(made.name, Uint8Array.from(atob(made.base64), (letter) => letter.charCodeAt(0)), "application/zip");
  return "Saved.";
}

async function begin() {
  wire();
  machines.restore();
  const linked = await machines.fromLink(location.hash);
  if (linked) history.replaceState(null, "", location.pathname);
  const given = await (await fetch("begin")).json();
  const there = machines.state.machines;
  const known = there.findIndex((item) => item.name === given.name && item.text === given.text);
  const wanted = !linked && (given.asked || !there.length);
  if (wanted && known < 0) machines.add(given.name, given.text);
  else if (wanted) machines.show(known);
  else changed(false);
}

begin();
