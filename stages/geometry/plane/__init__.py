"""Poses, motions and rays in the plane (SE(2))."""
