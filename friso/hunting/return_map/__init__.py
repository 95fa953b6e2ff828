"""Judge hunting by the return map, which gives the next landing from the present one."""
