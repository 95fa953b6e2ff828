"""Follow limit cycles along a line of stages, and locate where they lose stability."""
