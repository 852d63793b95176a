"""Prediction and observation into one belief, and the first belief of a log."""
