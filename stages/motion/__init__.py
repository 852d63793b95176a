"""Motion models: the belief after the robot has moved."""
