"""`friso app`: all of friso live in the browser, on this machine alone.

A page holds the machine; the server answers its questions with the functions that the command line asks. It owns no
physics, no words and no figure of its own.
"""
