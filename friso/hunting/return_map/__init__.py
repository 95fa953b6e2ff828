"""Judge hunting by the return map, which gives the next landing distance from the present one."""
