"""What `friso export` shows: the gains of a controller in the units of drives."""
