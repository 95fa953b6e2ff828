// The machine as a point on the map, which is dragged, or moved by arrows; and the small picture of a narrow page.
import { el } from "./dom.js";
import * as machines from "./state.js";

const STEP = 0.02; // of the map, by an arrow
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1] };

/** How the values [SI] of a map lie in a plot: `to` gives the pixels of a pair of values, `at` the values at pixels. */
function scale(plotted, { places }) {
  const { xaxis, yaxis } = plotted._fullLayout;
  const cells = plotted.data.find((trace) => trace.z);
  const sides = [[xaxis, cells.x, places.x], [yaxis, cells.y, places.y]].map(([axis, shown, si]) => ({
    axis, factor: shown.at(-1) / si.at(-1), low: Math.min(...si), high: Math.max(...si),
  }));
  const to = (values) => sides.map(({ axis, factor }, k) => axis._offset + axis.d2p(values[k] * factor));
  const at = (pixels) => sides.map(({ axis, factor, low, high }, k) => Math.min(high, Math.max(low, axis.p2d(pixels[k] - axis._offset) / factor)));
  return { to, at, size: [xaxis._length, yaxis._length] };
}

/** Lay a handle over a map at the values [SI] of the machine; `set` is called with values [SI] by key, and whether it is dragged on. */
export function handle(box, answer, values, set) {
  box.querySelector(".handle")?.remove();
  const plotted = box.querySelector(".plot");
  if (!plotted?.data?.some((trace) => trace.z) || values.some((value) => typeof value !== "number")) return;
  const { to, at, size } = scale(plotted, answer);
  const keys = [answer.axes.x, answer.axes.y];
  const move = (pixels, dragged) => {
    const now = at(pixels);
    place(now);
    set(Object.fromEntries(keys.map((key, k) => [key, now[k]])), dragged);
  };
  const point = el("button", { type: "button", class: "handle", "aria-label": "This machine on the map: drag it, or move it by arrows", title: "Drag this machine" });
  const place = (now) => {
    const [x, y] = to(now);
    point.style.left = `${x}px`;
    point.style.top = `${plotted.offsetTop + y}px`;
    point.values = now;
  };
  const pixels = (event) => {
    const { left, top } = plotted.getBoundingClientRect();
    return [event.clientX - left, event.clientY - top];
  };
  point.addEventListener("pointerdown", (event) => {
    point.setPointerCapture(event.pointerId);
    machines.hold();
  });
  point.addEventListener("pointermove", (event) => point.hasPointerCapture(event.pointerId) && move(pixels(event), true));
  point.addEventListener("keydown", (event) => {
    const way = ARROWS[event.key];
    if (!way) return;
    event.preventDefault();
    move(to(point.values).map((pixel, k) => pixel + [1, -1][k] * way[k] * STEP * size[k]), false);
  });
  place(values);
  box.append(point);
}

const SMALL = 150; // [px]

/** Draw the first of some figures small, for the top of a narrow page. */
export function small(place, { data, layout }) {
  const bare = (axis) => ({ ...axis, title: undefined, showticklabels: false, ticks: "", domain: [0, 1] });
  const axes = { xaxis: bare(layout.xaxis), yaxis: bare(layout.yaxis) };
  const first = data.filter((trace) => !/\d/.test(trace.xaxis ?? "x") && !/\d/.test(trace.yaxis ?? "y")).map((trace) => ({ ...trace, showscale: false, showlegend: false }));
  const shown = { ...axes, height: SMALL, margin: { l: 4, r: 4, t: 4, b: 4 }, showlegend: false, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", shapes: layout.shapes, autosize: true };
  return Plotly.react(place, first, shown, { staticPlot: true });
}
