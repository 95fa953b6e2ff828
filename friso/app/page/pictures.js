// The pictures of the answer, in tabs: each asks its own question.
import { $, el, tabs, words } from "./dom.js";
import { unitOf, withUnit, worded } from "./keys.js";
import { Beside } from "./beside.js";
import { handle, small } from "./handle.js";
import { Logs } from "./logs.js";
import { clear, draw } from "./plot.js";
import { Remedies } from "./remedies.js";
import { ANSWER, FIELDS, isNow, look, mark, now } from "./shown.js";
import * as machines from "./state.js";
import { ask, Live } from "./wire.js";
import { paragraphs, table } from "./tables.js";

const AT_REST = 250;
const LANE = "picture";
const HOME = "map";

export class Pictures {
  /** `sent` gives what is asked about, `tell` what is done with answers. */
  constructor(sent, tell) {
    Object.assign(this, { sent, tell, shown: HOME, then: null, machine: null, answer: null, timer: 0, kept: new Map() });
    this.live = this.follows("run");
    this.loops = this.follows("loops");
    this.tabs = [
      { id: "map", label: "Map" },
      { id: "run", label: "Run" },
      { id: "check", label: "Hunting" },
      { id: "bode", label: "Loops" },
      { id: "boundary", label: "Boundary" },
      { id: "flexure", label: "Leaf springs", when: () => this.has("flexure") },
      { id: "remedies", label: "What stops it" },
      { id: "logs", label: "Logs" },
    ];
    this.beside = new Beside(sent);
    this.own = { remedies: new Remedies(sent, tell), logs: new Logs(sent, tell) };
  }

  /** What answers a question again and again while a slider moves. */
  follows(question) {
    return new Live(question, LANE, 3000, (answer, { version, then }) => {
      this.arrived(answer, version);
      if (answer.kind !== "message" && answer.kind !== "partly") this.goOn(then);
    });
  }

  has(name) {
    return this.machine?.tables.some((item) => item.name === name && item.present);
  }

  body(options = {}) {
    return { ...this.sent(), options };
  }

  bar() {
    const there = this.machine ? [...this.tabs.filter((tab) => !tab.when || tab.when()), ...this.machine.others] : [];
    if (this.machine && !there.some((tab) => tab.id === this.shown)) this.show(HOME);
    const buttons = there.map(({ id, label }) =>
      el("button", { type: "button", role: "tab", id: `tab-${id}`, "aria-selected": String(id === this.shown), "aria-controls": "picture", onclick: () => this.show(id) }, label),
    );
    tabs($("pictures-bar"), buttons);
    if (this.machine) $("picture").setAttribute("aria-labelledby", `tab-${this.shown}`);
    else $("picture").removeAttribute("aria-labelledby");
  }

  show(id) {
    if (id !== this.shown) this.turn(id);
  }

  /** Show a tab anew. */
  turn(id) {
    this.shown = id;
    this.goOn();
    this.halt();
    this.bar();
    this.begin();
    this.ask();
  }

  /** The server has described the machine shown. */
  described(machine, version) {
    Object.assign(this, { machine, of: version });
    this.bar();
    if (!machines.dragging() && this.answer) this.glance();
    if ($("axes")) mark($("axes"), version, FIELDS);
  }

  /** Another machine was opened: the keys and ranges of its maps are others. */
  opened() {
    if (this.isMap()) this.begin();
  }

  isMap() {
    return this.shown === "map" || this.shown === "boundary";
  }

  /** Nothing that is on its way is of the machine as it is set now. */
  halt() {
    clearTimeout(this.timer);
    this.live.stop();
    this.loops.stop();
    this.beside.leave();
  }

  /** Nothing is computed on a lane any more, and nothing there says otherwise. */
  idle(lane) {
    if (lane === LANE) this.below?.querySelectorAll("progress").forEach((item) => item.remove());
  }

  /** There is no machine, and no tabs. */
  none() {
    this.machine = this.then = null;
    this.turn(HOME);
  }

  /** What stands on a tab before its answer is there. */
  begin() {
    const place = $("picture");
    if (this.plots) clear(this.plots);
    place.replaceChildren();
    this.form = null;
    this.plots = null;
    if (this.own[this.shown]) {
      place.append(this.own[this.shown].place);
      return look(); // the machine may be another one since it was there
    }
    this.plots = el("div", { class: "plots" });
    this.below = el("div", {});
    place.append(this.plots);
    if (this.isMap() && this.machine) this.form = this.axes(place);
    place.append(this.below);
  }

  /** The machine has changed; `dragged`: not yet for good. `then` is called once a picture that follows is drawn. */
  changed(dragged, then) {
    if (!dragged) this.bar();
    this.then = then;
    if (this.shown !== "run") this.goOn();
    if (this.own[this.shown]) return;
    if (!this.plots) this.begin();
    if (this.shown === "run") {
      this.live.ask(this.body(this.own.logs.laid()), { version: now(), then });
    } else {
      clearTimeout(this.timer);
      if (dragged && this.shown === "bode") return this.loops.ask(this.body(), { version: now(), then: null });
      this.halt();
      if (!dragged) this.timer = setTimeout(() => this.ask(), AT_REST);
    }
  }

  /** What waits for the picture of a machine goes on, by default that of the newest; nothing waits once the check is there. */
  goOn(then = this.then) {
    if (!this.then) return;
    if (then === this.then) this.then = null;
    then?.();
  }

  async ask() {
    const { shown } = this;
    if (!this.machine || this.own[shown] || this.of.machine.text !== machines.current().text) return; // asked once it is described
    if (shown === "run") return this.live.ask(this.body(this.own.logs.laid()), { version: now(), then: this.then });
    if (shown === "check") return this.tell.check();
    const options = this.form ? this.form() : {};
    if (options === null) return;
    if (!this.plots.children.length) this.below.replaceChildren(el("progress", { "aria-label": "Progress" })); // the line of the answer is the check's, too
    const version = now();
    if (shown === "map") options.coarse = this.rough = !version.concluded;
    const part = (answer) => this.shown === shown && (answer.kind === "partly" ? this.arrived(answer, version) : answer.kind !== "answer" && this.tell.progress(answer, LANE));
    const answer = await ask(shown, this.body(options), LANE, part);
    if (answer && answer.kind !== "partly" && this.shown === shown) this.arrived(answer, version);
  }

  /** The check has ended: a map that waited for it is refined. */
  concluded() {
    if (this.shown === "map" && this.rough) this.ask();
  }

  /** The check is there, whose figures are one of the pictures: what waits would tell less. */
  checked(answer, version) {
    this.then = null;
    if (this.shown === "check") this.arrived(answer, version);
  }

  /** An answer about a version of the machine is there, or a part of it. */
  arrived(answer, version) {
    if (answer.kind === "message" || answer.kind === "progress") return this.tell.progress(answer, LANE);
    if (answer.kind === "refused" || answer.kind === "failed") {
      if (this.form) clear(this.plots); // of other options, perhaps
      this.below.replaceChildren(...paragraphs([answer.text]));
      return mark(this.below, version);
    }
    Object.assign(this, { answer, version });
    if (answer.figures) draw(this.plots, answer.figures, { clicked: (point) => this.clicked(point), hovered: (point) => this.hovered(point), drawn: () => this.glance() }, answer.names);
    const free = this.shown === "map" && answer.axes ? Object.values(answer.axes) : [];
    for (const box of this.plots.children) if (answer.figures?.some((figure) => figure.name === box.dataset.name)) mark(box, version, ANSWER, free);
    if (answer.kind === "partly" && !answer.sentences.length && this.shown !== "map") return this.tell.shown(answer, this.shown, version); // its words follow
    const words = this.shown === "check" ? [] : answer.sentences;
    const working = answer.kind === "partly" ? [el("progress", { "aria-label": "Progress" })] : [];
    this.below.replaceChildren(...working, ...paragraphs([...words, ...answer.notes]), ...(this.shown === "run" ? [] : answer.tables.map(table)), ...paragraphs(answer.details));
    mark(this.below, version);
    this.tell.shown(answer, this.shown, version);
  }

  /** The handle on the map, and the small picture, of what is drawn. */
  glance() {
    const box = this.plots?.querySelector(".figure");
    const plotted = box?.querySelector(".plot");
    if (!plotted?.data) return;
    if ($("small").getClientRects().length) small($("small"), plotted);
    if (this.shown !== "map" || !this.answer.axes) return;
    const values = Object.values(this.answer.axes).map((path) => this.numeric().find((key) => key.path === path)?.si);
    handle(box, this.answer, values, (set, dragged) => this.tell.set(this.tell.worded(set), dragged));
  }

  numeric() {
    return this.machine.tables.filter((item) => item.present).flatMap((item) => item.keys);
  }

  // ---------------------------------------------------------------- maps

  /** The two keys of a map, with their ranges; gives the options of the question. */
  axes(place) {
    const numeric = this.numeric().filter((key) => key.range && typeof key.value === "string");
    const wanted = this.kept.get("axes") ?? ["controller.crossover", "friction.static"];
    const chosen = wanted.map((path, k) => numeric.find((key) => key.path === path) ?? numeric[k]);
    const fields = chosen.map((key, k) => this.axis(numeric, key, "xy"[k]));
    const start = () => {
      clearTimeout(this.timer);
      this.timer = setTimeout(() => this.ask(), AT_REST);
    };
    const metric = el("select", { id: "metric" }, ...this.machine.metrics.map(({ id, label }) => el("option", { value: id, selected: id === "sketch" }, label)));
    const log = this.tick("log", () => fields.every((item) => numeric.find((key) => key.path === item.key.value).range.log));
    const edge = this.tick("edge", () => false);
    for (const item of fields) item.key.addEventListener("change", log.again);
    const metrics = this.shown === "map" ? [el("label", {}, "Shown", metric), el("label", { class: "tick" }, edge.box, "Edge of hunting (about a minute)")] : [];
    const form = el("div", { class: "form" }, ...fields.map((item) => item.row), el("label", { class: "tick" }, log.box, "Logarithmic"), ...metrics);
    form.addEventListener("change", start);
    place.append(form);
    form.id = "axes";
    mark(form, this.of, FIELDS);
    return () => {
      this.kept.set("axes", fields.map((item) => item.key.value));
      const options = Object.fromEntries(fields.map((item, k) => ["xy"[k], `${item.key.value}=${item.low.value}..${item.high.value}`]));
      const ranges = { ...options, log: log.box.checked };
      return this.shown === "map" ? { ...ranges, metric: metric.value, edge: edge.box.checked } : ranges;
    };
  }

  /** A tick that stays as the user sets it, and is `usual` until he does. */
  tick(id, usual) {
    const box = el("input", { id, type: "checkbox" });
    const again = () => (box.checked = this.kept.get(id) ?? usual());
    box.addEventListener("change", () => this.kept.set(id, box.checked));
    again();
    return { box, again };
  }

  axis(numeric, chosen, name) {
    const key = el("select", { id: `${name}-key` }, ...numeric.map((item) => el("option", { value: item.path, selected: item === chosen }, `${words(item.path)} (${item.path.split(".")[0]})`)));
    const [low, high] = ["from", "to"].map((end) => el("input", { id: `${name}-${end}`, type: "text" }));
    const fill = () => {
      const item = numeric.find((one) => one.path === key.value);
      low.value = worded(item, item.si / 4, 3);
      high.value = worded(item, item.si * 4, 3);
    };
    const complete = ({ target }) => (target.value = withUnit(target.value, unitOf(numeric.find((one) => one.path === key.value))));
    for (const end of [low, high]) end.addEventListener("change", complete);
    key.addEventListener("change", fill);
    fill();
    const label = name === "x" ? "To the right" : "Upwards";
    return { key, low, high, row: el("div", { class: "axis" }, el("label", {}, label, key), el("label", {}, "from", low), el("label", {}, "to", high)) };
  }

  /** The values of the two keys of a map [SI] in a cell, null elsewhere. */
  cell(point) {
    if (this.shown !== "map" || !this.answer?.places || !point?.data.z) return null;
    const [row, column] = point.pointIndex;
    const { axes, places } = this.answer;
    return { [axes.x]: places.x[column], [axes.y]: places.y[row] };
  }

  /** A cell was clicked: the machine is set there. */
  clicked(point) {
    const values = this.cell(point);
    if (values && isNow(this.version)) this.tell.set(this.tell.worded(values));
  }

  /** The pointer is over a cell: its run is shown beside. */
  hovered(point) {
    const values = this.cell(point);
    if (values) this.beside.show(this.tell.worded(values));
    else this.beside.leave();
  }
}
