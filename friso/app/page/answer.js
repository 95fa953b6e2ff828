// The answer: a sentence per case, with its margin as soon as that is there; progress; and the history of answers.
import { $, el, roving } from "./dom.js";
import { paragraphs } from "./tables.js";
import { Working } from "./working.js";

let last = {};
const labels = new WeakMap(); // of each machine, the keys that its newest entry was given, and what that is called
const MOST = 200;
const working = new Working();
let complete = false;

/** Verdicts by run and cycle, which come while something is dragged. */
export function quick(answer) {
  const old = $("answer").querySelector(".rest");
  const cases = answer.cases.map(({ label, verdict }) => sentence(`${label}: ${verdict}.`, verdict));
  const rest = old ?? el("div", { class: "rest" });
  rest.querySelectorAll(".case").forEach((item) => item.remove());
  rest.querySelectorAll(".note").forEach((item) => item.classList.add("stale"));
  complete = false;
  working.say(answer.notes);
  $("answer").replaceChildren(...cases, rest, working.place);
}

const DRAWS = 200;

/** The whole answer; of a machine with uncertain keys, `draw` is called with how many machines are to be drawn. */
export function whole(answer, draw) {
  const cases = [];
  const rest = el("div", { class: "rest" });
  for (const text of answer.sentences) {
    const word = answer.cases.find(({ label }) => text.startsWith(`${label}:`))?.verdict ?? (answer.cases.length === 1 && !cases.length ? answer.cases[0].verdict : null);
    if (word) cases.push(sentence(text, word));
    else rest.append(el("p", { class: "note" }, text));
  }
  rest.append(...paragraphs(answer.notes));
  if (draw && !answer.asked.options.draws) rest.append(el("button", { type: "button", id: "draw", onclick: () => draw(DRAWS) }, `How probable is hunting? (${DRAWS} draws, minutes)`));
  complete = true;
  working.say([]);
  $("answer").replaceChildren(...cases, rest, working.place);
}

/** What is shown is of an earlier machine. */
export function earlier() {
  complete = false;
  $("answer").querySelectorAll(".case").forEach((item) => item.classList.add("stale"));
}

export function refused(text) {
  working.say([]);
  $("answer").replaceChildren(el("p", { class: "case", role: "alert" }, text), working.place);
}

function sentence(text, verdict) {
  const [label, ...more] = text.split(": ");
  return more.length ? el("p", { class: `case ${verdict}` }, el("b", {}, `${label}: `), more.join(": ")) : el("p", { class: `case ${verdict}` }, text);
}

/** Show what is being computed, or said of it; null for nothing. The whole answer says itself what is true of the machine. */
export function progress(part) {
  if (complete && part?.lasts) return;
  if (!working.place.isConnected) $("answer").append(working.place);
  working.show(part);
}

/** What sets the keys `given` apart from those of the entry before. */
function changed(before, given) {
  const paths = [...new Set([...Object.keys(before), ...Object.keys(given)])].filter((path) => before[path] !== given[path]);
  return paths.map((path) => `${path} ${path in given ? given[path] ?? "removed" : "as opened"}`).join(", ");
}

/** Note the answer for a machine with the keys that were `given`; a click on it goes back there. */
export function note(verdict, { machine, given }, back) {
  const text = JSON.stringify(given);
  if (last.machine === machine && last.text === text) return;
  last = { machine, text };
  const before = labels.get(machine) ?? { given: {}, label: "as opened" };
  const label = changed(before.given, given) || before.label;
  labels.set(machine, { given, label });
  const title = `${machine.name.replace(/\.toml$/, "")}, ${label}: ${verdict}`;
  $("history").prepend(el("button", { type: "button", class: verdict, title, "aria-label": `Back to ${title}`, onclick: () => back(machine, given) }));
  while ($("history").children.length > MOST) $("history").lastChild.remove();
  roving($("history"));
}
