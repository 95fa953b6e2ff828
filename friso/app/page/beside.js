// The run of a machine that is not chosen, beside the map on which the pointer is over it.
import { el, plain, words } from "./dom.js";
import { clear, draw } from "./plot.js";
import { Live } from "./wire.js";

const AFTER = 150;
const LONGEST = 3000;
const LANE = "beside";

/** A value as it is written, with four digits at most. */
const short = (value) => String(value).replace(/^\S+/, (number) => String(Number(Number(number).toPrecision(4))));

export class Beside {
  constructor(sent) {
    this.sent = sent;
    this.timer = 0;
    this.title = el("b", {});
    this.said = el("p", {});
    this.plots = el("div", {});
    this.place = el("aside", { id: "beside", "aria-label": "The run of this cell", hidden: true }, this.title, this.said, this.plots);
    document.body.append(this.place);
    this.live = new Live("cell", LANE, LONGEST, (answer, label) => this.arrived(answer, label));
  }

  /** Show the run with some keys changed, once the pointer rests. */
  show(changes) {
    clearTimeout(this.timer);
    this.timer = setTimeout(() => {
      const { machine, pinned } = this.sent();
      const label = Object.entries(changes).map(([path, value]) => `${words(path)} ${short(value)}`).join(", ");
      this.live.ask({ machine: { ...machine, changes: { ...machine.changes, ...changes } }, pinned, options: {} }, label);
    }, AFTER);
  }

  leave() {
    clearTimeout(this.timer);
    this.live.stop();
    this.place.hidden = true;
  }

  arrived(answer, label) {
    if (answer.kind === "message") return;
    this.place.hidden = false;
    this.title.textContent = label;
    this.said.textContent = plain(answer.kind === "answer" ? answer.sentences[0] : answer.text);
    if (answer.kind === "answer") draw(this.plots, answer.figures);
    else clear(this.plots);
  }
}
