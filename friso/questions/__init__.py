"""The questions that friso answers, a folder each: the function, what it says, shows and writes."""
