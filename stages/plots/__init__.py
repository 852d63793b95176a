"""Figures for the report, videos, trajectories and logs for other tools."""
