"""Continuity of a drive, as its images show it."""

from omninav.pipeline import Value


class Track(Value):
    """Whether a robot was surely where the belief says, and not carried since: each image continues the last one."""

    unbroken: bool
