"""Configurations, runs, sessions and sweeps as Python objects: what `import omninav` offers."""
