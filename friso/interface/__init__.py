"""The questions that friso answers, a function each: what `friso.check` and `friso check` share.

A module holds the function, whose keywords are the options of the command, and its `Answer`. The command line calls the
function and shows the answer; so does everyone else who imports friso.
"""
