// What leaves the page, when it is asked for: stage file, link, report with its figures, command and Python lines.
import { dialog, el, plain } from "./dom.js";

export function save(name, content, type) {
  const address = URL.createObjectURL(new Blob([content], { type }));
  el("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 10000);
}

/** The dialog, about one version of a machine, whatever is shown by the time that a button is pressed; `answer`: what is shown of it;
 * `link` makes a link, `files` asks for a report. */
export function out({ version, answer, link, files }) {
  const name = version.machine.name.replace(/\.toml$/, "");
  const status = el("p", { class: "status", role: "status" });
  const copied = async (text) => {
    // a page that comes unencrypted from another machine has no clipboard
    const done = await navigator.clipboard?.writeText(text).then(() => true, () => false);
    status.textContent = plain(`${done ? "Copied" : "To be copied"}: ${text}`);
  };
  const copy = (text) => el("button", { type: "button", onclick: () => copied(text) }, "Copy");
  const stage = el("button", { type: "button", disabled: true, onclick: () => save(`${name}.toml`, version.described.toml, "application/toml") }, "Stage file");
  const share = el("button", { type: "button" }, "Link that holds the machine");
  share.addEventListener("click", async () => copied(await link()));
  const asked = answer?.asked ?? { name: "check", options: {} };
  const report = el("button", { type: "button", disabled: true }, `Report, figures and data of friso ${asked.name} (ZIP)`);
  report.addEventListener("click", async () => {
    status.textContent = "The report is being made …";
    const made = await files(asked, (part) => (status.textContent = plain(part.label ?? part.text ?? "")));
    status.textContent = plain(made ?? "");
  });
  const there = () => [stage, report].forEach((button) => (button.disabled = !version.described));
  if (version.described) there();
  else {
    status.textContent = "The server has not read what was set last: until it has, there is no stage file of it. The link holds it.";
    version.read.then((part) => {
      there();
      status.textContent = version.described ? "" : plain(part.text);
    });
  }
  const lines = answer?.command ? [el("h3", {}, `The same on the command line, of ${answer.of}`), el("pre", {}, answer.command), copy(answer.command), el("h3", {}, "and in Python"), el("pre", {}, answer.python), copy(answer.python)] : [];
  dialog("Out", el("div", { class: "row" }, stage, share, report), status, ...lines);
}
