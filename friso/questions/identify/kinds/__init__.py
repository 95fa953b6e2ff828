"""How results are shown, one file a kind of experiment: each declares its `VIEW`, under the name of the kind."""
