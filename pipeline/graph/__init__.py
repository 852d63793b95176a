"""Stages, values and ports, and the graph that is built and checked from a configuration."""
