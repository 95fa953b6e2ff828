// What leaves the page, when it is asked for: stage file, link, report with its figures, command and Python lines.
import { dialog, el, plain } from "./dom.js";

export function save(name, content, type) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

/** The dialog; `machine` with its TOML, `answer` what is shown, `link` makes a link, `files` asks for a report. */
export function out({ machine, answer, link, files }) {
  const name = machine.name.replace(/\.toml$/, "");
  const status = el("p", { class: "status", role: "status" });
  const copied = async (text) => {
    // a page that comes unencrypted from another machine has no clipboard
    const done = await navigator.clipboard?.writeText(text).then(() => true, () => false);
    status.textContent = plain(`${done ? "Copied" : "To be copied"}: ${text}`);
  };
  const copy = (text) => el("button", { type: "button", onclick: () => copied(text) }, "Copy");
  const stage = el("button", { type: "button", onclick: () => save(`${name}.toml`, machine.toml, "application/toml") }, "Stage file");
  const share = el("button", { type: "button" }, "Link that holds the machine");
  share.addEventListener("click", async () => copied(await link()));
  const asked = answer?.asked ?? { name: "check", options: {} };
  const report = el("button", { type: "button" }, `Report, figures and data of friso ${asked.name} (ZIP)`);
  report.addEventListener("click", async () => {
    status.textContent = "The report is being made …";
    const made = await files(asked, (part) => (status.textContent = plain(part.label ?? part.text ?? "")));
    status.textContent = plain(made ?? "");
  });
  const lines = answer?.command ? [el("h3", {}, `The same on the command line, of ${answer.of}`), el("pre", {}, answer.command), copy(answer.command), el("h3", {}, "and in Python"), el("pre", {}, answer.python), copy(answer.python)] : [];
  dialog("Out", el("div", { class: "row" }, stage, share, report), status, ...lines);
}
