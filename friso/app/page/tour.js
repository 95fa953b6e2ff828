// A tour of one minute, on the machine that is shown.
import { dialog, el } from "./dom.js";

const STEPS = [
  ["drawing", "The machine", "A cart on a bearing carries the stage on a compliant joint. Click a part, or reach it by Tab and press Enter: its keys appear below. The switch above the joint locks it."],
  ["keys", "Its keys", "Drag a slider, or type a value with its unit. Point at a name to read what it means. Undo takes anything back."],
  ["answer", "The answer", "The verdict in a word, with buttons for what stops the hunting. Below, a sentence for each case, with its margin once you let go. Each bar is an earlier answer: click it to go back there."],
  ["pictures-bar", "The pictures", "The machine is a point on its map: drag it. Run shows the error with the joint locked and free. Hunting shows the cycle and what feeds it, Loops the limit cases, Map and Boundary where hunting ends: click a cell of the map to set the machine there."],
  ["pin", "Compare", "Pin keeps this machine in every picture, in grey, while you change the other one."],
  ["out", "Out", "The stage file, a report with its figures, the command that gives the same, and a link. Nothing is written unless you ask for it here."],
];

export function tour(step = 0) {
  const [place, title, text] = STEPS[step];
  document.querySelectorAll(".toured").forEach((item) => item.classList.remove("toured"));
  const target = document.getElementById(place);
  target.classList.add("toured");
  target.scrollIntoView({ block: "nearest" });
  const next = step + 1 < STEPS.length ? el("button", { type: "button", onclick: () => tour(step + 1) }, "Next") : null;
  const box = dialog(`${title} (${step + 1} of ${STEPS.length})`, el("p", {}, text), next ? el("div", { class: "row" }, next) : "");
  (next ?? box.querySelector("button")).focus();
  box.onclose = () => document.querySelectorAll(".toured").forEach((item) => item.classList.remove("toured"));
}
