"""How outcomes of the thesis's own experiments are shown, a module each."""
