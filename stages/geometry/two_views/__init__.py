"""Two views of the same points: matching, essential matrices, relative and absolute pose."""
