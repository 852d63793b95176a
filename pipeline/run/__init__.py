"""One run: its plan, its folder, its manifest and its results."""
