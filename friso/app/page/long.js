// A question that takes long, with its progress, an end, its answer, and the machines that it gives.
import { el } from "./dom.js";
import { draw } from "./plot.js";
import { paragraphs, table } from "./tables.js";
import { ask, end } from "./wire.js";
import { Working } from "./working.js";

/** Ask on a lane, and show progress and answer in a place; resolves to the answer, or null. */
export async function shownAnswer(place, lane, question, body, tell) {
  const working = new Working();
  working.show({ kind: "progress", label: "begun" });
  const stop = el("button", { type: "button", onclick: () => { end(lane); place.replaceChildren(); } }, "Stop");
  place.replaceChildren(working.place, stop);
  const asked = body();
  const answer = await ask(question, asked, lane, (part) => working.show(part));
  if (!answer) {
    if (place.contains(working.place)) place.replaceChildren(el("p", { class: "wrong note", role: "alert" }, "There is no answer: the server was gone. Ask again."));
    return null;
  }
  if (answer.kind !== "answer") {
    place.replaceChildren(el("p", { class: "wrong note", role: "alert" }, answer.text));
    return null;
  }
  const take = ({ name, toml }) => el("button", { type: "button", class: "take", onclick: () => tell.take(name, toml) }, `Take over: ${name}`);
  const plots = el("div", {});
  place.replaceChildren(
    ...paragraphs([...answer.sentences, answer.failure, ...answer.notes].filter(Boolean)),
    el("div", { class: "form" }, ...(answer.ways ?? []).map(take)),
    ...answer.tables.map(table),
    plots,
    ...paragraphs(answer.details),
  );
  draw(plots, answer.figures);
  if (JSON.stringify(body().machine) === JSON.stringify(asked.machine)) tell.shown(answer, lane);
  return answer;
}
