"""How a belief moves when the robot does."""
