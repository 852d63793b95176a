"""Figures for the report, trajectories and logs for other tools."""
