"""Likelihoods of poses, given what is seen."""
