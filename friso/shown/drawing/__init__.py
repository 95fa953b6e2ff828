"""Figures as plain data, and what draws them: on paper with matplotlib, on pages with plotly."""
