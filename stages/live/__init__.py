"""Robots that run now: transports of ROS 2 messages, and what is published of a run."""
