"""Where ticks come from: recordings of several kinds, and the simulator."""
