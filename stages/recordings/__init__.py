"""Readers and writers of logs, grids and camera files. No stages."""
