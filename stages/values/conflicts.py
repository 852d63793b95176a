"""Inputs that do not fit each other."""

from typing import Annotated, ClassVar

from omninav.pipeline import Bounds, Value


class Conflicts(Value):
    """Which inputs do not fit each other, as found so far: a sentence each, with its figures."""

    sentences: tuple[str, ...]


class MapFit(Value):
    """What a map's own images say of its poses: `sentences` as of `Conflicts`.

    `other_places`: how similar an image of the map is to the most similar one of another place, in the median; None
    where the map is too small to say so.
    """

    costly: ClassVar[bool] = True

    sentences: tuple[str, ...]
    other_places: Annotated[float | None, Bounds(ge=0, le=1)] = None
