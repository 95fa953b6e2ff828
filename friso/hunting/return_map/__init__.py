"""Judge hunting by the return map: from the present sticking distance to the next."""
