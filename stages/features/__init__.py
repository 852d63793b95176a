"""Panoramas into short descriptions of what is seen in which direction."""
