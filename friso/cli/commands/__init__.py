"""The commands: one module each, whose `COMMAND` is the command of the module's name."""
