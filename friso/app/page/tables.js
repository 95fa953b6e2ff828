// Tables and paragraphs of an answer.
import { el } from "./dom.js";

export function table({ title, columns, rows }) {
  const head = el("tr", {}, el("td"), ...columns.map((text) => el("th", { scope: "col" }, text)));
  const body = rows.map(([label, cells]) => el("tr", {}, el("th", { scope: "row" }, label), ...cells.map((text) => el("td", {}, text))));
  const caption = title ? el("caption", {}, title) : null;
  return el("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": title || "Table" }, el("table", {}, caption, el("thead", {}, head), el("tbody", {}, ...body)));
}

export const paragraphs = (texts) => texts.map((text) => el("p", { class: "note" }, text));
