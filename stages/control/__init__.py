"""From a homing vector or a ring of ranges to velocity commands."""
