"""Inputs that do not fit each other."""

from omninav.pipeline import Value

FOREIGN = "the images fit no place of the map"
"""Beginning of the sentence that a map is of another building, as far as images tell."""


class Conflicts(Value):
    """Which inputs do not fit each other, a sentence each, with its figures.

    `sentences`: all that was found so far; `standing`: those of them that still hold, those that mislead first;
    `misleading`: whether one holds for which the estimate may be wrong, and not only its stamp.
    """

    sentences: tuple[str, ...]
    standing: tuple[str, ...]
    misleading: bool
