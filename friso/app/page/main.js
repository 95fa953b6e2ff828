// The page: connects the machine, its keys, the answer and the pictures.
import * as answers from "./answer.js";
import { $, anew, el, plain, tabs } from "./dom.js";
import { drawing } from "./drawing.js";
import { edit, forgetRanges, keys, refuse, typing, worded } from "./keys.js";
import { out, save } from "./out.js";
import { Pictures } from "./pictures.js";
import * as machines from "./state.js";
import { tour } from "./tour.js";
import { ask, end, first, Live, OLD_AFTER, onReach } from "./wire.js";

const CHECKED_AFTER = 500;
let shown = null; // the machine as the server describes it
let chosen = "controller";
let wrong = null;
let given = new Map(); // the answers about this machine, by the tabs of their pictures
let timer = 0;
let aging = 0;
let held = "";
let begun = false;
let late = false; // what is on the left is drawn again once that takes nothing from under the hand
let pressed = false;
let drawn = {}; // the machine and the part whose keys are there

const sent = () => ({ machine: machines.sent(), pinned: machines.pinned() });
const set = (values, dragged = false) => machines.set(values, dragged);

const pictures = new Pictures(sent, {
  set: (values) => set(values),
  worded: withUnits,
  progress: answers.progress,
  shown: (part, tab) => given.set(tab, part),
  take: (name, toml) => machines.add(`${name.replaceAll(/\W+/g, "_")}.toml`, toml, true),
  check: () => (given.has("check") ? pictures.checked(given.get("check")) : check()),
});

const form = new Live("machine", "machine", 2000, described);
const verdict = new Live("verdict", "verdict", 5000, (part, tag) => {
  if (tag.machine !== machines.current()) return; // another one is shown by now
  if (part.kind === "message") return answers.progress(part);
  if (part.kind === "failed") return refused(part.text);
  if (part.kind !== "answer") return; // what is wrong with the machine is said where it was set
  answers.quick(part);
  if (tag.given === machines.changes()) clearTimeout(aging);
  else age();
  answers.note(part.verdict, tag, machines.back);
});

/** Unless a new answer comes soon, the one that is there is shown as that of an earlier machine. */
function age() {
  clearTimeout(aging);
  aging = setTimeout(answers.earlier, OLD_AFTER);
}

function refused(text) {
  clearTimeout(aging);
  answers.refused(text);
}

function withUnits(values) {
  const all = shown.tables.flatMap((table) => table.keys);
  return Object.fromEntries(
    Object.entries(values).map(([path, si]) => {
      const key = all.find((item) => item.path === path);
      return [path, worded(key, si)];
    }),
  );
}

function changed(dragged) {
  bar();
  late = false; // the answer draws it
  const machine = machines.current();
  if (!machine) return;
  clearTimeout(timer);
  end("check");
  age();
  given = new Map();
  answers.progress(null);
  if (shown && drawn.machine !== machine) {
    answers.earlier();
    pictures.earlier();
  }
  if (shown && held === machine.text && !wrong) {
    follow(dragged);
    if (dragged) return;
  }
  form.ask({ machine: machines.sent() }, machine);
}

/** The picture follows the machine, and then the verdict: both at once would be slower. */
function follow(dragged) {
  const tag = { machine: machines.current(), given: machines.changes() };
  const machine = machines.sent();
  pictures.changed(dragged, () => verdict.ask({ machine }, tag));
}

/** The server has read the machine, or refused it. */
function described(part, machine) {
  if (machine !== machines.current()) return; // another one is shown by now, and asked about
  if (part.kind === "refused" || part.kind === "failed") {
    wrong = { keys: part.key.split(", "), text: part.text };
    end("check");
    answers.progress(null);
    if (!shown || held !== machine.text) return without(part);
    usable();
    left();
    if ($("keys").querySelector(".wrong")) answers.earlier();
    else refused(part.text);
    return;
  }
  if (part.kind !== "answer") return;
  const opened = held !== machine.text;
  const another = wrong !== null || opened;
  wrong = null;
  shown = part;
  usable();
  if (opened) {
    held = machine.text;
    forgetRanges();
  }
  document.title = plain(`${part.title || machine.name}: friso`);
  left();
  pictures.machine = part;
  pictures.bar();
  if (opened) pictures.opened();
  if (another) follow(machines.dragging());
  clearTimeout(timer);
  if (!machines.dragging()) timer = setTimeout(check, CHECKED_AFTER);
}

/** What is of use with a machine alone, and of which nothing is wrong: what is handed out is what is shown. */
const usable = () => ["out", "pin"].forEach((id) => ($(id).disabled = !shown || wrong !== null));

/** A file that holds no machine: nothing of another one stays beside it, and its text can be mended here, unless it was the server that failed. */
function without(part) {
  const { name, text: toml } = machines.current();
  shown = null;
  held = "";
  late = false;
  verdict.stop();
  pictures.none();
  usable();
  document.title = plain(`${name}: friso`);
  $("drawing").replaceChildren();
  const again = part.kind === "failed";
  const onclick = again ? () => changed(false) : () => edit(toml, (mended) => machines.add(name, mended, true));
  $("keys").replaceChildren(el("button", { type: "button", onclick }, again ? "Ask again" : "Edit the file"));
  refused(part.text);
}

async function check(draws) {
  const asked = { machine: machines.current(), given: machines.changes() };
  const part = await ask("check", pictures.body(draws ? { draws } : {}), "check", (item) => item.kind !== "answer" && answers.progress(item));
  if (!part) return;
  answers.progress(null);
  if (part.kind !== "answer") return refused(part.text);
  verdict.stop();
  clearTimeout(aging);
  answers.whole(part, shown.uncertain.length ? check : null);
  answers.note(part.verdict, asked, machines.back); // it may come before the quick verdict, which is then not asked for
  given.set("check", part);
  pictures.checked(part);
}

function redraw() {
  const image = drawing(shown, chosen, choose, (locked) => set({ "joint.locked": locked }));
  anew($("drawing"), () => $("drawing").replaceChildren(image));
}

function left() {
  late = pressed && !machines.dragging(); // what is clicked would go before the click
  if (late) return;
  redraw();
  if (machines.dragging()) return; // the slider would go from under the hand; letting go asks again
  const machine = machines.current();
  late = typing() && drawn.machine === machine && drawn.part === chosen; // so would the field, with what is typed in it
  if (late) return refuse($("keys"), wrong);
  drawn = { machine, part: chosen };
  keys($("keys"), shown, chosen, machines.changes(), wrong, {
    set: (path, value, dragged = false) => machine === machines.current() && set({ [path]: value }, dragged),
    hold: machines.hold,
    release: machines.release,
    edit: () => edit(shown.toml, (text) => machines.add(machines.current().name, text, true)),
  });
}

const caughtUp = () => setTimeout(() => late && left());

/** Nothing on the left moves or goes from when the pointer is pressed to its click, which comes in one turn with its release. */
function pointed(event) {
  const before = pressed;
  pressed = event.buttons % 2 === 1;
  if (pressed === before) return;
  if (pressed) return document.activeElement?.closest(".key")?.classList.add("held");
  setTimeout(() => document.querySelector(".key.held")?.classList.remove("held"));
  caughtUp();
}

function choose(part) {
  chosen = part;
  left();
}

function bar() {
  const { state } = machines;
  const current = machines.current();
  const buttons = state.machines.map((machine, k) =>
    el("button", { type: "button", role: "tab", id: `machine-${k}`, "aria-selected": String(k === state.shown), "aria-controls": "left", onclick: () => machines.show(k), onkeydown: (event) => event.key === "Delete" && close(k) }, machine.name.replace(/\.toml$/, "")),
  );
  tabs($("machines"), buttons);
  if (current) $("left").setAttribute("aria-labelledby", `machine-${state.shown}`);
  $("close").disabled = state.machines.length < 2;
  $("undo").disabled = !current || current.step === 0;
  $("redo").disabled = !current || current.step === current.steps.length - 1;
  $("pin").setAttribute("aria-pressed", String(Boolean(state.pinned)));
  $("pin").textContent = state.pinned ? "Unpin" : "Pin";
}

/** The last machine stays. */
const close = (number) => machines.state.machines.length > 1 && machines.close(number);
const undo = () => machines.go(machines.current().step - 1);
const redo = () => machines.go(machines.current().step + 1);

async function opened(files) {
  const isStage = (file) => file.name.endsWith(".toml") && file.size < 4e6;
  for (const file of files.filter(isStage)) machines.add(file.name, await file.text());
  const logs = files.filter((file) => !isStage(file));
  if (!logs.length) return;
  pictures.show("logs");
  pictures.own.logs.add(logs);
}

const troubles = new Map();

/** Say what is wrong; of one matter, what was said last. */
function trouble(said, about = "") {
  troubles.set(about, plain(said));
  const text = [...troubles.values()].filter(Boolean).join("\n");
  if ($("trouble").textContent === text) return; // it is read out once
  $("trouble").textContent = text;
  $("trouble").hidden = !text;
}

function wire() {
  $("undo").addEventListener("click", undo);
  $("redo").addEventListener("click", redo);
  $("pin").addEventListener("click", () => machines.pin());
  $("open").addEventListener("click", () => $("file").click());
  $("close").addEventListener("click", () => {
    close(machines.state.shown);
    $(`machine-${machines.state.shown}`).focus();
  });
  $("file").addEventListener("change", () => opened([...$("file").files]));
  $("tour").addEventListener("click", () => tour());
  $("out").addEventListener("click", () => out({ machine: { name: machines.current().name, toml: shown.toml }, answer: given.get(pictures.shown) ?? given.get("check"), link: machines.link, files: report }));
  document.addEventListener("keydown", (event) => {
    if (event.target.matches?.("input[type=text], textarea, select")) return;
    if ($("dialog").open) return;
    if ((event.ctrlKey || event.metaKey) && event.key.toLowerCase() === "z") {
      event.preventDefault();
      $(event.shiftKey ? "redo" : "undo").click();
    } else if (event.altKey && ["p", "π"].includes(event.key.toLowerCase())) { // as a Mac has it
      event.preventDefault();
      $("pin").click();
    }
  });
  $("keys").addEventListener("focusout", caughtUp);
  document.addEventListener("dragover", (event) => event.preventDefault());
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    trouble("");
    opened([...event.dataTransfer.files]);
  });
  for (const moment of ["pointerdown", "pointermove", "pointerup", "pointercancel"]) document.addEventListener(moment, pointed, true);
  for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, machines.release);
  window.addEventListener("hashchange", linked);
  onReach((there, text) => {
    trouble(there ? "" : text);
    if (there && begun) changed(false);
    else if (there) begin();
  });
  machines.onChange(changed);
  machines.onKept((text) => trouble(text, "kept"));
}

/** Ask for what a command would write, and save it; resolves to what to say. */
async function report({ name, options }, part) {
  const made = await ask(`${name}.zip`, { ...sent(), options }, "report", part);
  if (!made || made.kind !== "files") return made?.text;
  save(made.name, Uint8Array.from(atob(made.base64), (letter) => letter.charCodeAt(0)), "application/zip");
  return "Saved.";
}

/** The machine of a link, if there is one. */
async function linked() {
  if (!location.hash) return false;
  const is = await machines.fromLink(location.hash);
  history.replaceState(null, "", location.pathname);
  trouble(is ? "" : "The link does not hold a machine; perhaps a part of it is missing.");
  return is;
}

async function begin() {
  const given = await first();
  if (!given) return;
  begun = true;
  const there = machines.state.machines;
  const known = there.findIndex((item) => item.name === given.name && item.text === given.text);
  const wanted = !(await linked()) && (given.asked || !there.length);
  if (wanted && known < 0) machines.add(given.name, given.text);
  else if (wanted) machines.show(known);
  else changed(false);
}

wire();
machines.restore();
begin();
