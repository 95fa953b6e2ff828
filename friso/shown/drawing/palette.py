"""Name the colours of lines, points and areas in figures."""

# Okabe & Ito, "Color universal design" (2008): distinguishable with any colour vision.
BLUE, VERMILLION, GREEN = "#0072B2", "#D55E00", "#009E73"
SKY, ORANGE, PINK, MAUVE = "#56B4E9", "#E69F00", "#CC79A7", "#8c6d8f"
INK, GREY, LIGHT = "#222222", "#767676", "#c9c9c9"
WHITE, BLACK = "#ffffff", "#111111"
"""Words on coloured ground, which are the same on a dark page."""

QUIET = "#d3e6f3"
"""Ground of what rests: a pale blue, far from the colours of swings and from white and grey."""

DARK = {
    INK: "#e6e7e9",
    GREY: "#9aa0a6",
    LIGHT: "#5a5f66",
    BLUE: "#3d9be0",
    SKY: "#a6d8f7",
    QUIET: "#1f3645",
    "#e3e3e3": "#2f3338",
    "#a9a9a9": "#777d84",
}
"""Colours on a dark page, by those on a light one. Others are the same on both."""
