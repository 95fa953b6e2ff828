// The answer: a sentence per case, with its margin as soon as that is there; progress; and the history of answers.
import { $, el, plain } from "./dom.js";
import { paragraphs } from "./tables.js";

let last = {};
const MOST = 200;
let status = null;

/** Verdicts by run and cycle, which come while something is dragged. */
export function quick(answer) {
  const old = $("answer").querySelector(".rest");
  const cases = answer.cases.map(({ label, verdict }) => sentence(`${label}: ${verdict}.`, verdict));
  const rest = old ?? el("div", { class: "rest" });
  rest.querySelectorAll(".case").forEach((item) => item.remove());
  rest.querySelectorAll(".note").forEach((item) => item.classList.add("stale"));
  $("answer").replaceChildren(...cases, rest, line());
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
  $("answer").replaceChildren(...cases, rest, line());
}

/** What is shown is of an earlier machine. */
export const earlier = () => $("answer").querySelectorAll(".case").forEach((item) => item.classList.add("stale"));

export function refused(text) {
  $("answer").replaceChildren(el("p", { class: "case", role: "alert" }, text), line());
}

function sentence(text, verdict) {
  const [label, ...more] = text.split(": ");
  return more.length ? el("p", { class: `case ${verdict}` }, el("b", {}, `${label}: `), more.join(": ")) : el("p", { class: `case ${verdict}` }, text);
}

function line() {
  status ??= el("p", { class: "status" });
  return status;
}

/** What is being computed; "" for nothing. */
export function progress(part) {
  const place = line();
  if (!place.isConnected) $("answer").append(place);
  if (!part) place.replaceChildren();
  else if (part.kind === "message") place.replaceChildren(plain(part.text));
  else {
    const bar = el("progress", part.total ? { value: part.done, max: part.total, "aria-label": "Progress" } : { "aria-label": "Progress" });
    place.replaceChildren(bar, plain(part.label));
  }
}

/** Note the answer for a machine with the keys that were `given`; a click on it goes back there. */
export function note(verdict, { machine, given }, back) {
  const text = JSON.stringify(given);
  if (last.machine === machine && last.text === text) return;
  last = { machine, text };
  const changed = Object.entries(given).at(-1)?.join(" ") ?? "as opened";
  const title = `${machine.name.replace(/\.toml$/, "")}, ${changed}: ${verdict}`;
  $("history").prepend(el("button", { type: "button", class: verdict, title, "aria-label": `Back to ${title}`, onclick: () => back(machine, given) }));
  while ($("history").children.length > MOST) $("history").lastChild.remove();
}
