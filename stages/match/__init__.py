"""Similarity of the present view to the views of the map."""
