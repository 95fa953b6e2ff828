"use strict";
// Plotly and the figures stand compressed in the page. Where a browser cannot unpack them, their pictures are shown.
const unpacked = async (element) => {
  const bytes = Uint8Array.from(atob(element.textContent), (letter) => letter.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).text();
};
const plotly = (async () => {
  const script = document.createElement("script");
  script.textContent = await unpacked(document.getElementById("plotly"));
  document.head.append(script);
})();
(async () => {
  await plotly;
  for (const packed of document.querySelectorAll("script.figure")) {
    const { data, layout, narrow, bars, config } = JSON.parse(await unpacked(packed));
    const place = packed.previousElementSibling;
    const isNarrow = place.parentElement.clientWidth < 640;
    const chosen = isNarrow ? narrow : layout;
    if (isNarrow) bars.forEach((bar, k) => bar && Object.assign(data[k].colorbar ?? data[k].marker.colorbar, bar));
    place.style.height = `${chosen.height}px`;
    await Plotly.newPlot(place, data, chosen, config);
  }
})().catch((error) => {
  document.documentElement.classList.add("still");
  console.error(error);
});
