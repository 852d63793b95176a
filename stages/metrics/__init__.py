"""How good a run was: errors against ground truth, trajectory errors, size of the map."""
