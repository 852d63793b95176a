"""Velocity commands from a homing vector or a ring of ranges."""
