// What is being computed, and below it what was said meanwhile that stays true of the answer.
import { el, plain } from "./dom.js";
import { paragraphs } from "./tables.js";

export class Working {
  constructor() {
    this.now = el("p", { class: "status", role: "status" });
    this.said = el("div", { "aria-live": "polite" });
    this.place = el("div", {}, this.now, this.said);
  }

  /** Show a part that reports progress or says something; null where nothing is being computed. */
  show(part) {
    if (!part) this.now.replaceChildren();
    else if (part.kind === "message" && part.lasts) this.add(part.text);
    else if (part.kind === "message") this.now.replaceChildren(plain(part.text));
    else if (part.kind === "progress") {
      const bar = el("progress", part.total ? { value: part.done, max: part.total, "aria-label": "Progress" } : { "aria-label": "Progress" });
      this.now.replaceChildren(bar, plain(part.label));
    }
  }

  add(text) {
    if (![...this.said.children].some((item) => item.textContent === plain(text))) this.said.append(...paragraphs([text]));
  }

  /** What was said so far, and nothing else. */
  say(texts) {
    this.said.replaceChildren();
    texts.forEach((text) => this.add(text));
  }
}
