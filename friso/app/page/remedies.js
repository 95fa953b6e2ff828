// What stops the hunting: the ways of tune and of design, and machines that are taken over from them.
import { el } from "./dom.js";
import { withUnit } from "./keys.js";
import { shownAnswer } from "./long.js";

export class Remedies {
  constructor(sent, tell) {
    const within = el("input", { id: "within", type: "text", placeholder: "e.g. 1 um", onchange: () => (within.value = withUnit(within.value, "um")) });
    const only = el("select", { id: "only" }, ...["", "controller", "joint"].map((word) => el("option", { value: word }, word || "anything")));
    this.result = el("div", {});
    const start = async (question, options) => {
      const { name, changes } = sent().machine;
      const given = Object.entries(changes).map(([path, value]) => `${path} = ${value ?? "nothing"}`);
      const about = `Of ${name} ${given.length ? `with ${given.join(", ")}` : "as it was opened"}:`;
      await shownAnswer(this.result, "remedies", question, () => ({ ...sent(), options: options() }), tell, about);
    };
    const tune = el("button", { type: "button", id: "tune", onclick: () => start("tune", () => ({ within: within.value, only: only.value })) }, "Find the least change");
    const design = el("button", { type: "button", id: "design", onclick: () => start("design", () => ({})) }, "Design an isolator");
    this.place = el(
      "div",
      {},
      el("p", { class: "note" }, "The least change of controller or joint that stops the hunting (friso tune), or a joint of leaf springs (friso design). Both take minutes."),
      el("div", { class: "form" }, el("label", {}, "In position within", within), el("label", {}, "May change", only), tune, design),
      this.result,
    );
  }
}
