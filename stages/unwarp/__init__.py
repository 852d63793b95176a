"""Pictures into panoramas: one file per projection."""
