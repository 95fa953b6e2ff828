"""Judge hunting by the return map: from the distance at which a stage lands to where it
lands next."""
