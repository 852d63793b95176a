"""From what is seen now and what was seen at a target to where the target lies."""
