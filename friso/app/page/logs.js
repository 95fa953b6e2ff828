// Logs: dropped files, their channels with roles, and the machine that they show.
import { el } from "./dom.js";
import { withUnit } from "./keys.js";
import { shownAnswer } from "./long.js";
import { paragraphs } from "./tables.js";
import { drop, end, hand } from "./wire.js";

const LARGEST = 64e6;
const SCALE = /^[-+]?[.\d]+(e[-+]?\d+)?\s*[^\s.\d/]/i; // and no "1/min"

export class Logs {
  constructor(sent, tell) {
    Object.assign(this, { sent, tell, files: [], roles: new Map(), measures: new Map(), recognised: {} });
    this.input = el("input", { type: "file", id: "log-files", multiple: true, "aria-label": "Logs", onchange: () => this.add([...this.input.files]) });
    this.status = el("div", { class: "status", role: "status" });
    this.form = el("div", { class: "form" });
    this.result = el("div", {});
    window.addEventListener("pagehide", (event) => event.persisted || this.letGo());
    this.place = el("div", {}, el("div", { class: "drop" }, "Drop logs here, or choose them: ", this.input), this.status, this.form, this.result);
  }

  async add(files) {
    const problems = [];
    for (const file of files) {
      try {
        this.files.push({ name: file.name, id: await this.kept(file) });
      } catch (error) {
        problems.push(`${file.name}: ${error.message}.`);
      }
    }
    this.list(problems);
    if (this.files.length) this.look();
  }

  /** The files by their names, each of which can be taken away, and what is wrong with others. */
  list(problems = []) {
    const item = (file) => el("li", {}, file.name, el("button", { type: "button", class: "plain", "aria-label": `Remove ${file.name}`, onclick: () => this.remove(file) }, "Remove"));
    this.status.replaceChildren(el("ul", { class: "files" }, ...this.files.map(item)), ...paragraphs(problems));
  }

  /** A file is taken away, such as one that was refused. */
  remove(file) {
    if (this.files.length === 1) return this.forget();
    this.files.splice(this.files.indexOf(file), 1);
    drop(file.id);
    this.list();
    this.look();
  }

  kept(file) {
    if (file.size <= LARGEST) return hand(file);
    const size = `${Math.round(file.size / 1e6)} MB, at most ${LARGEST / 1e6} MB are taken here`;
    throw new Error(`${size}: friso identify on the command line takes larger ones`);
  }

  options(more = {}) {
    const unit = {};
    const scale = {};
    for (const [role, text] of this.measures) {
      if (SCALE.test(text)) scale[role] = text;
      else unit[this.roles.get(role) ?? this.recognised[role] ?? role] = text;
    }
    return { ...this.sent(), options: { files: this.files.map((file) => file.id), map: Object.fromEntries(this.roles), unit, scale, dt: this.dt?.value ?? "", ...more } };
  }

  /** What the run asks for to have the first log laid over it. */
  laid() {
    return this.files.length ? this.options().options : {};
  }

  async look() {
    const answer = await shownAnswer(this.result, "logs", "logs", () => this.options(), this.tell);
    if (answer) this.fields(answer);
  }

  fields({ roles, channels, recognised }) {
    this.recognised = recognised;
    const offered = JSON.stringify([roles, channels]);
    if (this.form.children.length && offered === this.offered) return; // something may be being typed
    this.offered = offered;
    const choice = (role) => {
      const options = ["", ...channels].map((name) => el("option", { value: name, selected: name === (this.roles.get(role) ?? "") }, name || "as recognised"));
      const choose = (event) => {
        if (event.target.value) this.roles.set(role, event.target.value);
        else this.roles.delete(role);
        this.look();
      };
      const name = role.replaceAll("_", " ");
      const measure = el("input", { type: "text", id: `measure-${role}`, class: "measure", "aria-label": `Unit or scale of ${name}`, placeholder: "unit or scale", title: "Unit of the channel (mm), or scale (35.15 N/V), where the file does not say it", value: this.measures.get(role) ?? "", onchange: () => this.measured(role, measure.value) });
      return el("div", { class: "role" }, el("label", {}, name, el("select", { id: `role-${role}`, onchange: choose }, ...options)), measure);
    };
    this.dt = el("input", { type: "text", id: "sample-time", placeholder: "e.g. 1 ms", value: this.dt?.value ?? "" });
    this.dt.addEventListener("change", () => {
      this.dt.value = withUnit(this.dt.value, "ms");
      this.look();
    });
    this.assumed = el("input", { type: "checkbox", id: "assumed", checked: this.assumed?.checked ?? false });
    const start = () => {
      const assumed = this.assumed.checked;
      const about = assumed ? `With ${this.sent().machine.name} as what is known:` : "";
      shownAnswer(this.result, "logs", "identify", () => this.options({ assumed }), this.tell, about);
    };
    const fields = [
      ...roles.map(choice),
      el("label", {}, "sample time", this.dt),
      el("label", { class: "tick" }, this.assumed, "The machine shown is what is known"),
      el("button", { type: "button", id: "identify", onclick: start }, "Identify"),
      el("button", { type: "button", onclick: () => this.forget() }, "Other files"),
    ];
    this.form.replaceChildren(...fields);
  }

  /** The unit or the scale of a role's channel is told, or "" for that of the file. */
  measured(role, text) {
    if (text.trim()) this.measures.set(role, text.trim());
    else this.measures.delete(role);
    this.look();
  }

  /** The server keeps no file that the page has let go. */
  letGo() {
    end("logs");
    this.files.splice(0).forEach(({ id }) => drop(id));
  }

  forget() {
    this.letGo();
    this.roles.clear();
    this.measures.clear();
    this.input.value = "";
    this.status.replaceChildren();
    this.form.replaceChildren();
    this.result.replaceChildren();
  }
}
