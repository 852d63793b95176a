"""Inputs that nobody meant: mutators for every format, and what every reader must make of them."""
