"""Comparing views: descriptors, rotations between them, visual distance."""
