"""The simulator: worlds from a configuration and a seed, seen by any camera from an exactly known pose."""
