"""Measures of a run: errors against ground truth, trajectory errors, size of the map."""
