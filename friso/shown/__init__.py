"""Show results to people: figures as plain data, their renderers, and the report.

Nothing is imported here, because matplotlib, plotly, jinja2 and xarray are heavy. The command line imports a module
when it needs it.
"""
