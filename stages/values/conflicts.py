"""Inputs that do not fit each other."""

from omninav.pipeline import Value


class Conflicts(Value):
    """Which inputs do not fit each other, as found so far: a sentence each, with its figures."""

    sentences: tuple[str, ...]
