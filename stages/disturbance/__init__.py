"""What is done to panoramas on purpose, to see what a method stands."""
