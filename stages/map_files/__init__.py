"""Maps in files: joined, thinned, cut."""
