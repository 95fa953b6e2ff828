// Figures as the server gives them, drawn by plotly in the colours of the page.
import { el, plain } from "./dom.js";

const dark = matchMedia("(prefers-color-scheme: dark)");
const NARROW = 640;
const RESIZED = 100; // [ms]
const CONFIG = { displaylogo: false, modeBarButtons: [["toImage"], ["zoom2d", "pan2d"], ["resetScale2d"]], showSendToCloud: false, plotlyServerURL: "" };

/** What is ringed in white is seen on any ground, and keeps its colours. */
const isRinged = (value) => value.line?.color === "white";

/** A part of a figure in the colours of a dark page, as the figure names them. */
function themed(value, colours) {
  if (typeof value === "string") return colours[value] ?? value;
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value) || isRinged(value)) return value;
  if (Array.isArray(value)) return value.length && ArrayBuffer.isView(value[0]) ? value : value.map((item) => themed(item, colours));
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, themed(item, colours)]));
}

/**
 * Draw figures into a place, keeping the plots that are there: those of the same name are updated, first those that are
 * in sight. `tell` is called with the point that is `clicked`, and with that which the pointer is over (`hovered`), null
 * once it is gone; and after each time that a plot is drawn (`drawn`). `names` are those of all figures that are to be there, null while that is not known: what is there stays.
 */
export function draw(place, figures, tell = {}, names = figures.map((figure) => figure.name)) {
  const boxes = () => new Map([...place.children].filter((child) => child.dataset.name).map((child) => [child.dataset.name, child]));
  const there = boxes();
  if (names) for (const [name, child] of there) if (!names.includes(name)) remove(child);
  for (const figure of figures) {
    let box = there.get(figure.name);
    if (!box) {
      const heading = el("h3", {}, figure.title);
      const caption = el("p", { class: "caption" }, figure.caption);
      box = el("section", { class: "figure", "data-name": figure.name }, heading, caption, el("div", { class: "plot" }));
      place.append(box);
    } else {
      box.children[0].textContent = plain(figure.title);
      box.children[1].textContent = plain(figure.caption);
    }
    const plotted = box.querySelector(".plot");
    plotted.style.height = `${figure.layout.height}px`;
    plotted.due = () => {
      delete plotted.due;
      plot(plotted, figure, tell);
    };
  }
  const all = boxes();
  if (names?.some((name, k) => place.children[k]?.dataset.name !== name)) place.append(...names.map((name) => all.get(name)).filter(Boolean));
  const [seen, below] = [[], []];
  for (const plotted of place.querySelectorAll(".plot")) (inSight(plotted) ? seen : below).push(plotted);
  for (const plotted of seen) plotted.due?.();
  later(below);
}

const inSight = (place) => {
  const { top, bottom } = place.getBoundingClientRect();
  return top < innerHeight && bottom > 0;
};

/** Plots that are due, one after the other, so that the page answers in between. */
function later([next, ...rest]) {
  if (!next) return;
  setTimeout(() => {
    if (next.isConnected) next.due?.();
    later(rest);
  });
}

const narrow = (place) => place.parentElement.clientWidth < NARROW;

/** The traces on a narrow page: their colour bars stand elsewhere. */
function withBars({ data, bars }) {
  const moved = (holder, bar) => ({ ...holder, colorbar: { ...holder.colorbar, ...bar } });
  return data.map((trace, k) => {
    if (!bars[k]) return trace;
    return trace.colorbar ? moved(trace, bars[k]) : { ...trace, marker: moved(trace.marker, bars[k]) };
  });
}

function plot(place, figure, tell) {
  place.narrow = narrow(place);
  const given = place.narrow ? { data: withBars(figure), layout: figure.narrow } : figure;
  const layout = { ...given.layout, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", uirevision: figure.name, autosize: true };
  const fresh = !place.data;
  place.figure = figure;
  place.style.height = `${layout.height}px`;
  const [data, shown] = dark.matches ? [given.data, layout].map((part) => themed(part, layout.meta.dark)) : [given.data, layout];
  Plotly.react(place, data, shown, CONFIG);
  if (!fresh) return;
  if (tell.clicked) place.on("plotly_click", (event) => tell.clicked(event.points[0]));
  if (!tell.hovered) return;
  place.on("plotly_afterplot", tell.drawn);
  place.on("plotly_hover", (event) => tell.hovered(event.points[0]));
  place.on("plotly_unhover", () => tell.hovered(null));
}

function remove(child) {
  const place = child.querySelector(".plot");
  if (place) Plotly.purge(place);
  child.remove();
}

export function clear(place) {
  [...place.children].forEach(remove);
}

/** Those plots again that are drawn otherwise by now. */
function again(isOther) {
  for (const place of document.querySelectorAll(".plot")) if (place.figure && isOther(place)) plot(place, place.figure, {});
}

dark.addEventListener("change", () => again(() => true));

/** A plot at the width that it has by now, drawn whole: plotly alone leaves legends where they were, over titles. */
async function fit(place) {
  if (!place.data || !place.getClientRects().length) return;
  if (place.narrow !== narrow(place)) plot(place, place.figure, {});
  await Plotly.Plots.resize(place);
  if (place.data) await Plotly.redraw(place);
}

let resized = 0;
window.addEventListener("resize", () => {
  clearTimeout(resized);
  resized = setTimeout(async () => {
    for (const place of document.querySelectorAll(".plot")) await fit(place);
  }, RESIZED);
});
