"""Plots and pictures for the report, trajectories and logs for other tools."""
