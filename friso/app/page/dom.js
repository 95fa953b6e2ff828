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

function filled(element, attributes, children) {
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") element.toggleAttribute(name, value);
    else if (value !== null && value !== undefined) element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** A random text. Pages that come unencrypted from another machine have no crypto.randomUUID. */
export const token = () => Array.from(crypto.getRandomValues(new Uint32Array(4)), (number) => number.toString(36)).join("");

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
