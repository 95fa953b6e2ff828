"""Run `friso app`: all of friso live in the browser, on this machine alone.

A page holds the machine. The server answers its questions with the functions behind the command line. It has no
physics, words or figures of its own.
"""
