"""MCAP files of ROS 2 messages: a reader that trusts nothing and a writer that writes whole files."""
