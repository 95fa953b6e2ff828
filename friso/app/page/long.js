// A question that takes long, with its progress, an end, its answer, and the machines that it gives.
import { el } from "./dom.js";
import { draw } from "./plot.js";
import { mark, now } from "./shown.js";
import { paragraphs, table } from "./tables.js";
import { ask, end } from "./wire.js";
import { Working } from "./working.js";

/** Ask on a lane, and show progress and answer in a place; resolves to the answer, or null. What is asked is `about` the machine shown,
 * in these words, or with "" about none. */
export async function shownAnswer(place, lane, question, body, tell, about = "") {
  const version = now();
  const working = new Working();
  working.show({ kind: "progress", label: "begun" });
  const stop = el("button", { type: "button", onclick: () => { end(lane); place.replaceChildren(); } }, "Stop");
  const words = paragraphs([about].filter(Boolean));
  place.replaceChildren(...words, working.place, stop);
  const answer = await ask(question, body(), lane, (part) => working.show(part));
  const failed = (text) => place.replaceChildren(...words, el("p", { class: "wrong note", role: "alert" }, text));
  if (!answer) {
    if (place.contains(working.place)) failed("There is no answer: the server was gone. Ask again.");
    return null;
  }
  if (answer.kind !== "answer") {
    failed(answer.text);
    return null;
  }
  const take = ({ name, toml }) => el("button", { type: "button", class: "take", onclick: () => tell.take(name, toml) }, `Take over: ${name}`);
  const plots = el("div", {});
  const shown = el(
    "div",
    {},
    ...paragraphs([...answer.sentences, answer.failure, ...answer.notes].filter(Boolean)),
    el("div", { class: "form" }, ...(answer.ways ?? []).map(take)),
    ...answer.tables.map(table),
    plots,
    ...paragraphs(answer.details),
  );
  place.replaceChildren(...words, shown);
  draw(plots, answer.figures);
  if (about) mark(shown, version);
  tell.shown(answer, lane, version);
  return answer;
}
