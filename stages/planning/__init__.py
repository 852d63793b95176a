"""From where the robot is believed to be to where it shall go."""
