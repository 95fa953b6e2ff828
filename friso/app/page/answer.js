// The answer: a sentence per case, with its margin as soon as that is there; progress; and the history of answers.
import { $, el, roving } from "./dom.js";
import { difference, mark, now } from "./shown.js";
import { paragraphs } from "./tables.js";
import { Working } from "./working.js";

let last = {};
const labels = new WeakMap(); // of each machine, the keys that its newest entry was given, and what that is called
const MOST = 200;
const working = new Working();
const [word, cases, rest] = [el("div", { class: "word" }), el("div", {}), el("div", { class: "rest" })];
let complete = false;
let concluded = ""; // the verdicts from which the rest concludes
let shownBy = ""; // the lane whose progress is shown

/** What a verdict is in a word, as regions of the map are called. */
const WORDS = { hunts: "Hunts", bistable: "A kick starts it", transient: "Slow", settles: "Settles" };

/** What sets a machine as a button says, or takes that back: `set` is called with keys and values [SI]. */
let cures = { set: () => {}, taken: () => null, back: () => {} };
export const onCure = (told) => (cures = told);

/** Show the verdict on a version, what is said of it in a line for each case, and the rest, which is left where it is null. */
function show(version, answer, newCases, newRest) {
  const taken = cures.taken();
  const ways = (answer.cures ?? []).map(({ label, values }) => el("button", { type: "button", class: "cure", onclick: () => cures.set(label, values) }, label));
  const back = taken ? [el("button", { type: "button", class: "cure", onclick: cures.back }, `Take back: ${taken}`)] : [];
  const short = (answer.in_short ?? "none").replace(answer.verdict, WORDS[answer.verdict] ?? answer.verdict);
  const said = short === "none" ? [] : [el("strong", { class: answer.certain && !short.startsWith("unstable") ? answer.verdict : "" }, answer.state ? `${answer.state}: ${short}` : short)];
  word.replaceChildren(...said, ...ways, ...back);
  cases.replaceChildren(...newCases);
  if (newRest) rest.replaceChildren(...newRest);
  $("verdict").replaceChildren(word);
  $("answer").replaceChildren(cases, rest, working.place);
  for (const element of [word, cases, ...(newRest ? [rest] : [])]) mark(element, version);
}

/** What decides whether a conclusion still holds: the machine, and its verdicts. */
const verdicts = (answer, { machine }) => JSON.stringify([machine.name, machine.text, answer.cases]);

/** Verdicts by run and cycle, which come while something is dragged. */
export function quick(answer, version) {
  complete = false;
  say(answer.notes, version);
  const holds = verdicts(answer, version) === concluded;
  show(version, answer, answer.cases.map(({ label, verdict }) => sentence(`${label}: ${verdict}.`, verdict)), holds ? null : []);
}

function say(texts, version) {
  working.say(texts);
  mark(working.said, version);
}

const DRAWS = 200;

/** The whole answer; of a machine with uncertain keys, `draw` is called with how many machines are to be drawn. */
export function whole(answer, version, draw) {
  const [first, more] = [[], []];
  for (const text of answer.sentences) {
    const word = answer.cases.find(({ label }) => text.startsWith(`${label}:`))?.verdict ?? (answer.cases.length === 1 && !first.length ? answer.cases[0].verdict : null);
    if (word) first.push(sentence(text, word));
    else more.push(el("p", { class: "note" }, text));
  }
  more.push(...paragraphs(answer.notes));
  if (draw && !answer.asked.options.draws) more.push(el("button", { type: "button", id: "draw", onclick: () => draw(DRAWS) }, `How probable is hunting? (${DRAWS} draws, minutes)`));
  complete = true;
  concluded = verdicts(answer, version);
  say([], version);
  show(version, answer, first, more);
}

/** Whether a whole answer is no longer what is to be said; what it says stays until there is more. */
export function changed() {
  complete = false;
}

export function refused(text, version) {
  say([], version);
  show(version, {}, [el("p", { class: "case", role: "alert" }, text)], []);
}

function sentence(text, verdict) {
  const [label, ...more] = text.split(": ");
  return more.length ? el("p", { class: `case ${verdict}` }, el("b", {}, `${label}: `), more.join(": ")) : el("p", { class: `case ${verdict}` }, text);
}

/** Show what is being computed on a lane, or said of it. The whole answer says itself what is true of the machine. */
export function progress(part, lane) {
  if (complete && part.lasts) return;
  if (!working.place.isConnected) $("answer").append(working.place);
  shownBy = lane;
  if (part.lasts) mark(working.said, now());
  working.show(part);
}

/** Nothing is computed on a lane any more. */
export function idle(lane) {
  if (lane === shownBy) working.show(null);
}

/** Note the answer for a machine with the keys that were `given`; a click on it goes back there. */
export function note(verdict, { machine, given }, back) {
  const text = JSON.stringify(given);
  if (last.machine === machine && last.text === text) return;
  last = { machine, text };
  const before = labels.get(machine) ?? { given: {}, label: "as opened" };
  const label = difference(before.given, given) || before.label;
  labels.set(machine, { given, label });
  const title = `${machine.name.replace(/\.toml$/, "")}, ${label}: ${verdict}`;
  $("history").prepend(el("button", { type: "button", class: verdict, title, "aria-label": `Back to ${title}`, onclick: () => back(machine, given) }));
  while ($("history").children.length > MOST) $("history").lastChild.remove();
  roving($("history"));
}
