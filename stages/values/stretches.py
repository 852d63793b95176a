"""Stretches of a drive in which the estimate was not to be trusted."""

from typing import Literal

from omninav.pipeline import Value

StretchState = Literal["searching", "unsure", "blind", "wrong", "jumped"]


class Stretch(Value):
    """Successive images, the state of the localisation in them, and what happened.

    `searching`: not sure yet; `unsure`: not sure any more; `blind`: images that show nothing; `wrong`: sure, and beside
    the truth; `jumped`: the one image at which a sure estimate is elsewhere than odometry leads.
    """

    log: int
    """Number of the log."""
    first: int
    """Its first image."""
    last: int
    """Its last image."""
    start_s: float
    """When it begins, since the log's first image (s)."""
    end_s: float
    """When its last image was taken (s)."""
    metres: float
    """Distance by odometry within it (m)."""
    state: StretchState
    """State of the localisation."""
    cause: str
    """The cause, in a few words."""
    evidence: str
    """The same with the numbers that support it, a sentence; with ground truth how far the estimate was off."""
    advice: str
    """Advice: a line to type, or a thing to check; or empty."""

    @property
    def images(self) -> str:
        """Its images, in words."""
        return f"image {self.first}" if self.first == self.last else f"images {self.first} to {self.last}"


class Stretches(Value):
    """All stretches of a drive that were not tracked, in order."""

    all: tuple[Stretch, ...]
