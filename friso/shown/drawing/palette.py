"""Name the colours of lines, points and areas in figures."""

# Okabe & Ito, "Color universal design" (2008): distinguishable with any colour vision.
BLUE, VERMILLION, GREEN = "#0072B2", "#D55E00", "#009E73"
SKY, ORANGE, PINK, MAUVE = "#56B4E9", "#E69F00", "#CC79A7", "#8c6d8f"
INK, GREY, LIGHT = "#222222", "#767676", "#c9c9c9"
