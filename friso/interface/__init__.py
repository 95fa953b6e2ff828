"""The interface of questions, each a Python function with a command: what `friso.check` and `friso check` share.

A module holds the function, whose keywords are the options of the command, and its `Answer`. The command line calls the
function and shows the answer; so does everyone else who imports friso.
"""
