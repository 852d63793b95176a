"""Routes from where the robot is believed to be to its goal."""
