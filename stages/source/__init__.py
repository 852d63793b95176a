"""Sources of ticks: recorded drives and the simulator; and what is known of the place they are in."""
