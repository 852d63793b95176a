"""Pure functions of geometry: SE(2), particles, cameras. Arrays in, arrays out."""
