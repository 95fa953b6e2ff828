"""Run commands that do more than show an answer: one module each, with the function `run`."""
