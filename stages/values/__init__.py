"""Values that travel on the wires: arrays with a meaning, each in the frame and units its docstring states."""
