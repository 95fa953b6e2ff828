// The answer: a sentence per case, with its margin as soon as that is there; progress; and the history of answers.
import { $, el, plain } from "./dom.js";
import { paragraphs } from "./tables.js";

const history = [];
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

/** The whole answer. */
export function whole(answer) {
  const cases = [];
  const rest = el("div", { class: "rest" });
  for (const text of answer.sentences) {
    const word = answer.cases.find(({ label }) => text.startsWith(`${label}:`))?.verdict ?? (answer.cases.length === 1 && !cases.length ? answer.cases[0].verdict : null);
    if (word) cases.push(sentence(text, word));
    else rest.append(el("p", { class: "note" }, text));
  }
  rest.append(...paragraphs(answer.notes));
  $("answer").replaceChildren(...cases, rest, line());
}

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

/** Note an answer; a click on it goes back there. */
export function note(verdict, changes, label, go) {
  const text = JSON.stringify(changes);
  if (history.at(-1)?.text === text) return;
  history.push({ text });
  const title = `${label}: ${verdict}`;
  $("history").prepend(el("button", { type: "button", class: verdict, title, "aria-label": `Back to ${title}`, onclick: () => go(changes) }));
  while ($("history").children.length > MOST) $("history").lastChild.remove();
}
