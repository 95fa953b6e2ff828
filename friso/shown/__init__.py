"""What a person looks at: figures as plain data, their renderers, and the report.

Nothing is imported here: matplotlib, plotly, jinja2 and xarray are heavy, so the command line imports the
module it needs when it needs it.
"""
