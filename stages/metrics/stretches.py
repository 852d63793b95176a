"""Stretches of a drive in which the estimate was not to be trusted, by its columns of `frames.csv`."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import groupby
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import counted
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.confidence import MIN_EMPTY, MIN_SEEN, SURE_STATES
from omninav.stages.values.conflicts import FOREIGN
from omninav.stages.values.stretches import Stretch, StretchState

Columns = Mapping[str, npt.NDArray[Any]]

BLIND_CORRELATION, MIN_CONTRAST = 0.15, 1.0 / 255.0
"""Correlation with the ones before below which images show nothing (`InputConflicts`), and contrast below which they do
not: a grey level."""
OFF_MAP_SCALES, OFF_MAP_SCALES_BY_APPEARANCE = 5.0, 2.0
"""Distance from the nearest reference, in length scales, at which half of the images have a pose by landmarks
(`ConfidenceMonitor`), and beyond which a best match is of another place (without landmarks)."""
MIN_PART = 5
"""Images off the map, or on it, in a row that are a stretch of their own."""
NEAR_M, NEAR_SCALES = 0.5, 2.0
"""A pose by landmarks is at the estimate within the confidence's tolerance (m), a best match within this many length
scales."""
GAP_M, GAP_SHARE = 0.5, 0.1
"""Distance (m, plus a share of the metres driven) from odometry's prediction that working odometry never exceeds."""
MAX_HEADING_ERROR_DEG = 10.0
"""Median error of the heading of sure estimates, 0 beside the true place, from which on it is reported, degrees."""
NOT_RECORDED = (
    "This run recorded no causes, which only particle filters in a map do (nodes.evidence, as in variant=omninav)."
)
"""Sentence on a run without `ImageEvidence`."""


class Log:
    """The columns of one log of `frames.csv`; what was not recorded is NaN, or empty."""

    def __init__(self, columns: Columns) -> None:
        self.columns, self._arrays = columns, dict[str, Array]()

    def __len__(self) -> int:
        return len(self.columns["frame"])

    def __getitem__(self, name: str) -> Array:
        if name not in self._arrays:
            column = np.ma.asarray(self.columns.get(name, np.full(len(self), np.nan)))
            self._arrays[name] = np.asarray(np.ma.filled(column.astype(np.float64), np.nan))
        return self._arrays[name]

    def known(self, name: str) -> bool:
        """Tells whether a column was recorded."""
        return bool(np.isfinite(self[name]).any())

    def texts(self, name: str) -> list[str]:
        """A column of texts; "" where nothing was recorded."""
        found = self.columns.get(name)
        texts = [""] * len(self) if found is None else np.ma.filled(np.ma.asarray(found, object), "").tolist()
        return [text if isinstance(text, str) else "" for text in texts]

    @cached_property
    def estimates(self) -> Array:
        """Poses (N, 3)."""
        return np.column_stack([self[f"estimate_{axis}"] for axis in ("x", "y", "heading")])

    @cached_property
    def motion(self) -> Array:
        """Odometry's motion (N, 3) since the image before; 0 where it is not known."""
        return np.nan_to_num(np.column_stack([self[f"motion_{axis}"] for axis in ("x", "y", "turn")]))

    @cached_property
    def conflicts(self) -> list[str]:
        """The inputs that do not fit each other at each image; "": none."""
        return self.texts("conflict")

    @cached_property
    def sure(self) -> Bools:
        """Which estimates are sure: by the robot's state, or without a monitor by the belief's concentration."""
        states = self.texts("state")
        stated = np.isin(states, SURE_STATES) if any(states) else self["confident"] == 1.0
        return np.asarray(np.isfinite(self["estimate_x"]) & stated)

    @cached_property
    def blind(self) -> Bools:
        """Which images show nothing, in rows of `MIN_EMPTY` and more."""
        empty = (self["correlation"] < BLIND_CORRELATION) | (self["contrast"] < MIN_CONTRAST)
        empty |= self["features"] < MIN_SEEN
        if self.known("similarity") and (self.known("confidence") or self.known("match_lead")):
            empty |= ~np.isfinite(self["similarity"])
        return without_short(empty, MIN_EMPTY)

    @cached_property
    def off_map(self) -> Bools:
        """Which estimates are beside the map and have no landmarks there, in rows of `MIN_PART` and more."""
        limit = OFF_MAP_SCALES if self.known("landmarks") else OFF_MAP_SCALES_BY_APPEARANCE
        beside = (self["nearest_scales"] > limit) & ~(self["landmarks_away_m"] < NEAR_M)
        return without_short(beside, MIN_PART)

    @cached_property
    def gate(self) -> float:
        """Distance of a best match from the estimate at which it still is of that place (m)."""
        away = self["nearest_scales"] > 0.0
        return max(NEAR_M, NEAR_SCALES * median(self["nearest_m"][away] / self["nearest_scales"][away]))

    @cached_property
    def agrees(self) -> Bools:
        """Sure estimates that the image confirms, by landmarks or else by its best match, where these are known."""
        by_match = self["match_away_m"] < self.gate if self.known("match_away_m") else np.ones(len(self), np.bool_)
        near = np.where(np.isfinite(self["landmarks_away_m"]), self["landmarks_away_m"] < NEAR_M, by_match)
        return np.asarray(self.sure & ~self.blind & near)

    @cached_property
    def jumps(self) -> Array:
        """Distance (m) of each sure estimate from where odometry leads from a sure one before, beyond what is usual.

        0 without a confidence: a place, or an image's best match, jumps at every other image.
        """
        if not self.known("confidence"):
            return np.zeros(len(self))
        away = np.hypot(*(self.estimates[1:] - compose(self.estimates[:-1], self.motion[1:]))[:, :2].T)
        beyond = away - GAP_SHARE * np.hypot(*self.motion[1:, :2].T)
        measured = np.isfinite(self["motion_x"][1:])
        return np.concatenate([[0.0], np.where(self.sure[1:] & self.sure[:-1] & measured, beyond, 0.0)])


@dataclass(frozen=True)
class Part:
    """Rows `first` to `last` of a log, in one state."""

    log: Log
    first: int
    last: int
    state: StretchState

    def __len__(self) -> int:
        return self.last + 1 - self.first

    def __getitem__(self, name: str) -> Array:
        return self.log[name][self.first : self.last + 1]

    def goes_on_with(self, other: "Part") -> bool:
        """Tells whether another part follows in the same state."""
        return (self.log, self.last + 1, self.state) == (other.log, other.first, other.state)

    def median(self, name: str) -> float:
        """Median of what is known of a column; NaN where nothing is."""
        return median(self[name])

    @cached_property
    def metres(self) -> float:
        """Distance by odometry to the first image, and from it to the last one (m)."""
        return float(np.hypot(*self.log.motion[self.first : self.last + 1, :2].T).sum())

    @cached_property
    def usual_brightness(self) -> float:
        """Median brightness of the images of the log in which the estimate was sure."""
        return median(self.log["brightness"][self.log.sure & ~self.log.blind])

    @cached_property
    def at_estimate(self) -> float:
        """Share of images whose best match is at the estimate; without any 0."""
        return float((self["match_away_m"] < self.log.gate).mean())

    @cached_property
    def landmarks_agree(self) -> float:
        """Share of images with a pose by landmarks at the estimate."""
        return float((self["landmarks_away_m"] < NEAR_M).mean())


def logs_of(columns: Columns) -> list[Log]:
    """The logs of a run, in their order."""
    logs = np.asarray(columns["log"])
    numbers = dict.fromkeys(logs.tolist())
    return [Log({name: column[logs == number] for name, column in columns.items()}) for number in numbers]


def parts(log: Log, lost_m: float) -> Iterator[Part]:
    """The stretches of one log that were not tracked; the part off the map is one of its own."""
    begun = np.maximum.accumulate(log.sure)
    states = np.where(log.sure, "", np.where(begun, "unsure", "searching")).astype(object)
    states[log.sure & (log.jumps > GAP_M)] = "jumped"
    states[log.sure & (log["position_error_m"] > lost_m)] = "wrong"
    states[log.blind] = "blind"
    unsure = states == "unsure"
    fits = np.array([not text or text.startswith(FOREIGN) for text in log.conflicts])
    beside = without_short(unsure & log.off_map & fits, MIN_PART)
    beside = unsure & ~without_short(unsure & ~beside, MIN_PART) & beside.any()
    row = 0
    for (state, _), group in groupby(zip(states.tolist(), beside.tolist(), strict=True)):
        length = len(list(group))
        if state:
            yield Part(log, row, row + length - 1, state)
        row += length


def in_short(log: Log) -> str:
    """Sums up how sure one log was, in a sentence or two."""
    images, sure = counted(len(log), "image"), np.flatnonzero(log.sure)
    if not len(sure):
        return f"Never sure in {images}."
    if not log.known("confidence") and log.sure.all() and (log["estimate_weight"] == 1.0).all():
        return "Nothing is known of how sure the estimates are: this variant states one pose, whatever it saw."
    start, all_on = int(log["frame"][sure[0]]), bool(log.sure[sure[0] :].all())
    words = f"Sure of the estimate from image {start} to the end ({counted(len(sure), 'image')})."
    if not all_on:
        words = f"Sure of the estimate in {100 * len(sure) / len(log):.0f} % of {images}, from image {start} on."
    turned = median(np.where(log["position_error_m"] > log.gate, 0.0, np.abs(log["heading_error_deg"]))[log.sure])
    if turned > MAX_HEADING_ERROR_DEG:
        words += f" By ground truth its heading is off by {turned:.0f} degrees (median): check the camera's yaw."
    return words if log.known("nearest_m") else f"{words} {NOT_RECORDED}"


def summaries(logs: Sequence[Log]) -> list[str]:
    """A summary of each log; of several, each with its number."""
    texts = [in_short(log) for log in logs]
    return [f"Log {number}: {text}" for number, text in enumerate(texts)] if len(texts) > 1 else texts


def row_of(stretch: Stretch, several: bool) -> tuple[str, str, str, str, str, str, str]:
    """A stretch as texts: images (after the log, of several), seconds, metres, state, cause, evidence, advice."""
    log = f"{stretch.log}:" if several else ""
    images = f"{stretch.first}" if stretch.first == stretch.last else f"{stretch.first}-{stretch.last}"
    seconds = f"{stretch.start_s:.1f}-{stretch.end_s:.1f}" if stretch.last > stretch.first else f"{stretch.start_s:.1f}"
    evidence = stretch.evidence[:1].upper() + stretch.evidence[1:] + "."
    return log + images, seconds, f"{stretch.metres:.1f}", stretch.state, stretch.cause, evidence, stretch.advice


def median(values: Array) -> float:
    """The median of what is known; NaN where nothing is."""
    known = values[np.isfinite(values)]
    return float(np.median(known)) if len(known) else math.nan


def without_short(flags: Bools, least: int) -> Bools:
    """Bools (N,), those taken away of which fewer than `least` follow each other."""
    from scipy.ndimage import binary_opening  # type: ignore[attr-defined]

    return np.asarray(binary_opening(flags, np.ones(least)))
