"""Hold figures as plain data, and draw them: on paper with matplotlib, on pages with plotly."""
