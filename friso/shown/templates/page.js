"use strict";
// Plotly and the figures stand compressed in the page. Where a browser cannot unpack them, their pictures are shown.
const bytesOf = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
const unpacked = async (element) => {
  return new Response(new Blob([bytesOf(element.textContent)]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
};
// Numbers of four bytes: the first bytes of all of them come first. Those of a plane are an array for each row.
const numbers = ({ planes, shape }) => {
  const bytes = bytesOf(planes);
  const mixed = new Uint8Array(bytes.length);
  bytes.forEach((byte, k) => (mixed[(4 * k) % bytes.length + Math.floor((4 * k) / bytes.length)] = byte));
  const flat = new Float32Array(mixed.buffer);
  const [rows, columns] = shape.split(",").map(Number);
  if (!columns) return flat;
  return Array.from({ length: rows }, (_, row) => flat.subarray(row * columns, (row + 1) * columns));
};
// Colours on a dark page; what is ringed in white is seen on any ground.
const darkness = matchMedia("(prefers-color-scheme: dark)");
const themed = (value, colours) => {
  if (!darkness.matches) return value;
  if (typeof value === "string") return colours[value] ?? value;
  if (value === null || typeof value !== "object" || ArrayBuffer.isView(value) || value.line?.color === "white") return value;
  if (Array.isArray(value)) return value.map((item) => themed(item, colours));
  return Object.fromEntries(Object.entries(value).map(([name, item]) => [name, themed(item, colours)]));
};
const CLEAR = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)" };
const plotly = (async () => {
  const script = document.createElement("script");
  script.textContent = await unpacked(document.getElementById("plotly"));
  document.head.append(script);
})();
// A figure with the layout that its place has room for; colour bars stand elsewhere on a narrow screen.
const drawer = (place, { data, layout, narrow, bars, config }) => {
  const withBar = (holder, bar) => ({ ...holder, colorbar: { ...holder.colorbar, ...bar } });
  const moved = (trace, bar) => {
    if (!bar) return trace;
    return trace.colorbar ? withBar(trace, bar) : { ...trace, marker: withBar(trace.marker, bar) };
  };
  let drawn = null;
  return async () => {
    const isNarrow = place.parentElement.clientWidth < 640;
    const again = drawn !== null;
    const now = `${isNarrow} ${darkness.matches}`;
    if (drawn !== now) {
      drawn = now;
      const chosen = isNarrow ? narrow : layout;
      place.style.height = `${chosen.height}px`;
      const traces = isNarrow ? data.map((trace, k) => moved(trace, bars[k])) : data;
      await Plotly.react(place, ...[traces, { ...chosen, ...CLEAR }].map((part) => themed(part, layout.meta.dark)), config);
    }
    if (!again) return;
    await Plotly.Plots.resize(place);
    await Plotly.redraw(place); // plotly alone leaves legends where they were, over titles
  };
};
(async () => {
  await plotly;
  const drawers = [];
  let resized = 0;
  const again = () => {
    clearTimeout(resized);
    resized = setTimeout(async () => {
      for (const draw of drawers) await draw();
    }, 100);
  };
  window.addEventListener("resize", again);
  darkness.addEventListener("change", again);
  for (const packed of document.querySelectorAll("script.figure")) {
    const parts = JSON.parse(await unpacked(packed), (_, value) => (value?.planes === undefined ? value : numbers(value)));
    const draw = drawer(packed.previousElementSibling, parts);
    await draw();
    drawers.push(draw);
  }
})().catch((error) => {
  document.documentElement.classList.add("still");
  console.error(error);
});
