// The page: connects the machine, its keys, the answer and the pictures.
import * as answers from "./answer.js";
import { $, anew, el, plain, tabs } from "./dom.js";
import { drawing, PARTS } from "./drawing.js";
import { alongTracks, colourTracks, edit, forgetRanges, keys, refuse, typing, worded } from "./keys.js";
import { out, save } from "./out.js";
import { Pictures } from "./pictures.js";
import { DRAWING, FIELDS, isNow, look, mark, now } from "./shown.js";
import * as machines from "./state.js";
import { tour } from "./tour.js";
import { ask, end, first, Live, onIdle, onReach } from "./wire.js";

const CHECKED_AFTER = 500;
let shown = null; // the machine as the server describes it
let seen = null; // which version of it that is
let chosen = "controller";
let wrong = null;
let timer = 0;
let held = "";
let begun = false;
let late = false; // what is on the left is drawn again once that takes nothing from under the hand
let pressed = false;
let tracked = { version: null, tracks: {} }; // the verdicts along the sliders, and the version that they are of
let drawn = {}; // the machine and the part whose keys are there

const sent = () => ({ machine: machines.sent(), pinned: machines.pinned() });
const set = (values, dragged = false) => machines.set(values, dragged);

answers.onCure({ set: (label, values) => machines.cure(label, withUnits(values)), taken: machines.cured, back: () => undo() });

const pictures = new Pictures(sent, {
  set,
  worded: withUnits,
  progress: answers.progress,
  shown: (part, tab, version) => version.answers.set(tab, part),
  take: (name, toml) => machines.add(`${name.replaceAll(/\W+/g, "_")}.toml`, toml, true),
  check: () => (now().answers.has("check") ? pictures.checked(now().answers.get("check"), now()) : check()),
});

const form = new Live("machine", "machine", 2000, described);
const verdict = new Live("verdict", "verdict", 5000, (part, version) => {
  if (version.machine !== machines.current()) return; // another one is shown by now
  if (part.kind === "message") return answers.progress(part, "verdict");
  if (part.kind === "failed") return answers.refused(part.text, version);
  if (part.kind !== "answer") return; // what is wrong with the machine is said where it was set
  version.answers.set("verdict", part);
  answers.quick(part, version);
  answers.note(part.verdict, version, machines.back);
});

function withUnits(values) {
  const all = shown.tables.flatMap((table) => table.keys);
  return Object.fromEntries(
    Object.entries(values).map(([path, si]) => {
      return [path, typeof si === "number" ? worded(all.find((item) => item.path === path), si) : si];
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
  answers.changed();
  look();
  if (drawn.machine !== machine) document.title = plain(`${machine.name}: friso`);
  if (shown && held === machine.text && !wrong) {
    follow(dragged);
    if (dragged) return;
  } else pictures.halt();
  form.ask({ machine: machines.sent() }, now());
}

/** The picture follows the machine, and then the verdict: both at once would be slower. */
function follow(dragged) {
  const version = now();
  pictures.changed(dragged, () => version.answers.has("verdict") || verdict.ask({ machine: version.sent }, version)); // a slider that is let go keeps its verdict
}

/** The server has read the machine, or refused it. */
function described(part, version) {
  const { machine } = version;
  if (part.kind === "answer") version.described = part;
  if (part.kind === "partly") version.opened = part;
  if (part.kind !== "message" && part.kind !== "partly") version.settle(part);
  if (machine !== machines.current()) return; // another one is shown by now, and asked about
  if (part.kind === "refused" || part.kind === "failed") {
    wrong = { keys: part.key.split(", "), text: part.text };
    end("check");
    if (!shown || held !== machine.text) {
      without(part, version);
      if (!version.opened) return;
      [shown, seen, held] = [version.opened, version, machine.text]; // its wrong key can be set here
      forgetRanges();
      chosen = PARTS.find(({ tables }) => tables.includes(wrong.keys[0].split(".")[0]))?.id ?? chosen;
    }
    usable();
    left();
    if (!$("keys").querySelector(".wrong")) answers.refused(part.text, version);
    return;
  }
  if (part.kind !== "answer") return;
  const opened = held !== machine.text || !pictures.machine;
  const another = wrong !== null || opened;
  wrong = null;
  shown = part;
  seen = version;
  usable();
  if (opened) {
    held = machine.text;
    forgetRanges();
  }
  document.title = plain(`${part.title || machine.name}: friso`);
  left();
  pictures.described(part, version);
  if (opened) pictures.opened();
  if (another) follow(machines.dragging());
  clearTimeout(timer);
  if (!machines.dragging()) timer = setTimeout(check, CHECKED_AFTER);
}

/** What is of use with a machine alone, and of which nothing is wrong: what is handed out is what is shown. */
const usable = () => ["out", "pin"].forEach((id) => ($(id).disabled = !shown || wrong !== null));

/** A file that holds no machine: nothing of another one stays beside it, and its text can be mended here, unless it was the server that failed. */
function without(part, version) {
  const { name, text: toml } = version.machine;
  shown = null;
  held = "";
  late = false;
  verdict.stop();
  pictures.none();
  usable();
  document.title = plain(`${name}: friso`);
  $("drawing").replaceChildren();
  mark($("drawing"), version, DRAWING);
  mark($("keys"), version, FIELDS);
  const again = part.kind === "failed";
  const onclick = again ? () => changed(false) : () => edit(toml, (mended) => machines.add(name, mended, true));
  $("keys").replaceChildren(el("button", { type: "button", onclick }, again ? "Ask again" : "Edit the file"));
  answers.refused(part.text, version);
}

/** Colour the sliders' tracks by the verdict along them. */
async function tracks() {
  const version = now();
  const part = await ask("tracks", pictures.body({ values: alongTracks() }), "tracks");
  if (part?.kind === "answer" && isNow(version)) colourTracks((tracked = { version, tracks: part.tracks }).tracks);
}

async function check(draws) {
  const version = now();
  const part = await ask("check", pictures.body(draws ? { draws } : {}), "check", (item) => item.kind !== "answer" && answers.progress(item, "check"));
  if (!part || !isNow(version)) return;
  version.concluded = true;
  pictures.concluded();
  if (part.kind !== "answer") return answers.refused(part.text, version);
  verdict.stop();
  answers.whole(part, version, shown.uncertain.length ? check : null);
  answers.note(part.verdict, version, machines.back); // it may come before the quick verdict, which is then not asked for
  version.answers.set("check", part);
  pictures.checked(part, version);
  tracks();
}

function redraw() {
  const { machine } = seen;
  const image = drawing(shown, chosen, choose, (locked) => machine === machines.current() && set({ "joint.locked": locked }));
  anew($("drawing"), () => $("drawing").replaceChildren(image));
  mark($("drawing"), seen, DRAWING);
}

function left() {
  if (held !== machines.current().text) return; // what the server described is another machine
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
    controller: changeController,
    hold: machines.hold,
    release: machines.release,
    edit: editText,
  });
  mark($("keys"), now(), FIELDS);
  if (tracked.version && isNow(tracked.version)) colourTracks(tracked.tracks);
}

/** Set the keys with which the machine has another kind of controller. */
async function changeController(name) {
  const version = now();
  const part = await ask("controller", { machine: version.sent, options: { name } }, "controller");
  if (part?.kind === "answer" && isNow(version)) set(part.changes);
  else left(); // the kind is as it was
}

/** The text of the machine as it is set now, which the server may not have written yet. */
async function editText() {
  const version = now();
  if (!version.described) await version.read;
  if (!version.described || !isNow(version) || $("dialog").open) return;
  edit(version.described.toml, (text) => machines.add(version.machine.name, text, true));
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
  if (now().answers.has("check")) tracks();
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
  $("out").addEventListener("click", () => {
    const version = now();
    const answer = version.answers.get(pictures.shown) ?? version.answers.get("check");
    out({ version, answer, link: () => machines.link(version.sent), files: (asked, part) => report(version, asked, part) });
  });
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
  onIdle((lane) => {
    answers.idle(lane);
    pictures.idle(lane);
  });
  onReach((there, text) => {
    trouble(there ? "" : text);
    if (there && begun) changed(false);
    else if (there) begin();
  });
  machines.onChange(changed);
  machines.onKept((text) => trouble(text, "kept"));
}

/** Ask for what a command would write, and save it; resolves to what to say. */
async function report({ sent: machine, pinned }, { name, options }, part) {
  const made = await ask(`${name}.zip`, { machine, pinned, options }, "report", part);
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
