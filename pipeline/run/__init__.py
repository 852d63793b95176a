"""One run: its graph, its folder, its manifest and its results."""
