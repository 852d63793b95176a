"""Direction to a target from what is seen now and what was seen there."""
