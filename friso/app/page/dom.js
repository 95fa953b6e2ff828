// Elements without markup: texts are never read as HTML.
const SVG = "http://www.w3.org/2000/svg";

export const $ = (id) => document.getElementById(id);

/** An element with attributes, listeners (on...), and children: elements or texts. */
export function el(name, attributes = {}, ...children) {
  return filled(document.createElement(name), attributes, children);
}

export function svg(name, attributes = {}, ...children) {
  return filled(document.createElementNS(SVG, name), attributes, children);
}

// As friso/errors.py has them: control characters, marks and overrides of the direction of writing, what has no width.
const STEERING = /[\u0000-\u0008\u000b-\u001f\u007f-\u009f\u00ad\u061c\u180e\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ufff9-\ufffb\ud800-\udfff\u{e0000}-\u{e007f}]/gu;

/** A text that may come from a file, with what steers a page or a terminal written out: "\u202e". */
export const plain = (text) => String(text ?? "").replace(STEERING, (sign) => {
  const code = sign.codePointAt(0).toString(16);
  return code.length <= 2 ? `\\x${code.padStart(2, "0")}` : code.length <= 4 ? `\\u${code.padStart(4, "0")}` : `\\U${code.padStart(8, "0")}`;
});

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  const all = children.filter((child) => child !== null && child !== undefined);
  element.append(...all.map((child) => (typeof child === "string" ? plain(child) : child)));
  return element;
}

/** A random text. Pages that come unencrypted from another machine have no crypto.randomUUID. */
export const token = () => Array.from(crypto.getRandomValues(new Uint32Array(4)), (number) => number.toString(36)).join("");

/** Draw what is in a place anew: what has the focus there has it again, by its id, or else what `instead` gives for it; what was
 * selected in a field is selected, for it may be about to be typed over; and nothing is scrolled. */
export function anew(place, drawn, instead = () => null) {
  const before = place.contains(document.activeElement) ? document.activeElement : null;
  drawn();
  if (!before?.id) return;
  const item = $(before.id) ?? instead(before);
  item?.focus({ preventScroll: true });
  if (item?.type === "text" && before.type === "text") item.setSelectionRange(before.selectionStart, before.selectionEnd);
}

/** Where a key leads among tabs, from one of them; they are chosen by Enter, as what they show may take long to compute. */
const LEADS = {
  ArrowRight: (k, count) => (k + 1) % count,
  ArrowLeft: (k, count) => (k + count - 1) % count,
  Home: () => 0,
  End: (k, count) => count - 1,
};

function along(event) {
  const there = [...event.currentTarget.children];
  const from = there.indexOf(document.activeElement);
  if (from < 0 || !(event.key in LEADS) || event.ctrlKey || event.altKey || event.metaKey) return;
  event.preventDefault();
  there[LEADS[event.key](from, there.length)].focus();
}

/** Show tabs, of which Tab reaches the selected one, and arrows, Home and End the others. While they are the same, those that are
 * there stay, under the pointer that is pressed on them; else the one that is selected has the focus of one that is gone. */
export function tabs(place, buttons) {
  place.onkeydown = along;
  const there = [...place.children];
  const same = (button, k) => button.id === there[k]?.id && button.textContent === there[k].textContent;
  if (there.length === buttons.length && buttons.every(same)) {
    buttons.forEach((button, k) => there[k].setAttribute("aria-selected", button.getAttribute("aria-selected")));
  } else anew(place, () => place.replaceChildren(...buttons), () => place.querySelector("[aria-selected=true]"));
  for (const tab of place.children) tab.tabIndex = tab.getAttribute("aria-selected") === "true" ? 0 : -1;
}

/** Of the buttons in a place, Tab reaches the one that has the focus, or the first, and arrows, Home and End the others. */
export function roving(place) {
  const stop = (item) => [...place.children].forEach((one) => (one.tabIndex = one === item ? 0 : -1));
  place.onkeydown = (event) => {
    along(event);
    stop(document.activeElement);
  };
  stop(place.contains(document.activeElement) ? document.activeElement : place.firstElementChild);
}

/** "limiter_stiffness" as words. */
export const words = (key) => {
  const text = key.slice(key.lastIndexOf(".") + 1).replaceAll("_", " ");
  return text[0].toUpperCase() + text.slice(1);
};

/** Say something in a dialog; closes by Escape. */
export function dialog(title, ...children) {
  const box = $("dialog");
  const shut = el("button", { type: "button", onclick: () => box.close() }, "Close");
  box.replaceChildren(el("h2", { id: "dialog-title" }, title), ...children, el("div", { class: "row" }, shut));
  if (!box.open) box.showModal();
  return box;
}
