"""How some commands ask, where that takes more than showing the answer: a module each, with the function `run`."""
