"""What can be wired: stages, values, ports, and the graph that is built and checked from a configuration."""
