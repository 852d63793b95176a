"""What a run looks like: figures for the report, videos, trajectories and logs for other tools."""
