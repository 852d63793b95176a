"""Robots that run now: the source of their ticks, transports of ROS 2 messages, and what is published of a run."""
