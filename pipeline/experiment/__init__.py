"""Experiments: many runs of one specification, claims and verdicts, and the page about them."""
