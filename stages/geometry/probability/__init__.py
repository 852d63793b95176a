"""Gaussians, particles, clusters and evidence."""
