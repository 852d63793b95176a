"""Running a graph: the loop, checkpoints, sequences on disk, artifacts and caches."""
