"""What a finished run looks like: pictures for the report, trajectories and logs for other tools."""
