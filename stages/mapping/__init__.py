"""Maps learned along a drive."""
