"""Landmarks of a map, and the pose of an image that sees them."""

from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Covariances, RowsOf, Shape, Starts, Value
from omninav.stages.geometry.appearance.mirrored_patches import mirrored_sift
from omninav.stages.geometry.arrays import Array, Bools, Bytes, Floats, Ints
from omninav.stages.geometry.runs import chosen_runs

from .visual_words import VisualWords

DESCRIPTOR_SCALE = 512.0
"""Stored value of a descriptor's 1: of RootSIFT no number is larger than a half in practice."""


class Landmarks(Value):
    """Points of the world that several references of a map see, with what they look like, and the references' words.

    `points` (L, 3), float32 in older maps: x, y (m) in the map frame, z (m) above the camera's projection centre.
    `descriptors` (L, D) uint8: the mean of each point's descriptors as `stored_descriptors` makes them. Of reference r
    the points that it sees are `seen[starts[r]]` to `seen[starts[r + 1]]` (S,). `sigma_rad`: standard deviation of a
    bearing, as the map's own images miss its points. `words`: the visual words of the references, by which candidates
    are found. `found_rate`: the share of the map's own images, each left out, whose pose is found by the landmarks of
    others. `camera`: the text of the `camera.yaml` that fits the map's images, empty where it is as it was described.
    `variance_factor`: by which the squares of the errors of these images' poses exceed what their bearings imply.
    `described`, `mount` (3,): where the tour's camera sat on its robot (m, m, rad), as its description states and as
    its images show; `described_delay_s`, `delay_s`: the same of how much later than taken its images were stamped (s).
    `pose_sigmas` (R, 3): standard deviations of the references' poses in the map frame (m, m, rad), 0 where they were
    given and the images confirm them; None where nothing was adjusted. `mirrored`: descriptors are of images that show
    the world mirrored; None, as in older maps: as the images of whoever uses it.
    """

    points: Annotated[Array | Floats, Shape("L", 3)]
    descriptors: Annotated[Bytes, Shape("L", "D")]
    starts: Annotated[Ints, Shape("R+1"), Starts("S")]
    seen: Annotated[npt.NDArray[np.int32], Shape("S"), RowsOf("L")]
    sigma_rad: Annotated[float, Bounds(ge=1e-6, le=1)]
    words: Annotated[VisualWords, Shape("R")]
    found_rate: Annotated[float, Bounds(ge=0, le=1)]
    camera: str = ""
    variance_factor: Annotated[float, Bounds(ge=1, le=1e9)] = 2.5
    described: Annotated[Array, Shape(3)] = field(default_factory=lambda: np.zeros(3))
    mount: Annotated[Array, Shape(3)] = field(default_factory=lambda: np.zeros(3))
    described_delay_s: Annotated[float, Bounds(ge=-100, le=100)] = 0.0
    delay_s: Annotated[float, Bounds(ge=-100, le=100)] = 0.0
    pose_sigmas: Annotated[Array | None, Shape("R", 3), Bounds(ge=0, le=1e9)] = None
    mirrored: bool | None = None

    def __len__(self) -> int:
        return len(self.points)

    def contradiction(self) -> str | None:
        """Words are of the descriptors that landmarks have."""
        one, other = self.descriptors.shape[1], self.words.centres.shape[1]
        if one == other or not len(self) or not len(self.words.centres):
            return None
        return f"'words' are of descriptors of {other} numbers, those of the landmarks have {one}"

    def mounted(self, described: Array, placed: bool) -> Array:
        """Pose (3,) on the robot of the frame that bearings are in, of a camera whose description puts it at (3,).

        One that is described as the tour's was sits where the tour's images showed it, and so does one of which no
        position is described (`placed`).
        """
        as_the_tours = described == self.described
        same = as_the_tours[2] and (as_the_tours.all() or not placed)
        x, y = self.mount[:2] if same or not placed else described[:2]
        return np.array([x, y, self.mount[2] - described[2] if same else 0.0])

    def late_by(self, described_s: float | None) -> float:
        """Time (s) by which images are later than a description with this delay (None: without one) states."""
        if described_s is None:
            return self.delay_s
        return self.delay_s - described_s if described_s == self.described_delay_s else 0.0

    @property
    def references(self) -> int:
        """Number of references."""
        return len(self.starts) - 1

    def seen_by(self, references: Ints) -> Ints:
        """Rows (N,) of the points that any of some references sees, ascending."""
        shown = np.zeros(len(self), np.bool_)
        shown[self.seen[chosen_runs(self.starts, references)[0]]] = True
        return np.flatnonzero(shown)

    def of_references(self, rows: Ints) -> "Landmarks":
        """Those that some references (N,) see, for a map of these in this order; what none of them sees goes.

        A reference that a map has learned since sees none, and its pose is as uncertain as theirs in the mean.
        """
        own = np.minimum(rows, self.references)
        seen, starts = chosen_runs(self.starts, own)
        kept, renumbered = np.unique(self.seen[seen], return_inverse=True)
        sigmas = self.pose_sigmas
        if sigmas is not None:
            sigmas = np.vstack([sigmas, sigmas.mean(axis=0) if len(sigmas) else np.zeros(3)])[own]
        return replace(
            self,
            points=self.points[kept],
            descriptors=self.descriptors[kept],
            starts=starts,
            seen=renumbered.astype(np.int32),
            words=self.words.of_views(own),
            pose_sigmas=sigmas,
        )

    def as_mirrored(self, mirrored: bool | None) -> "Landmarks":
        """The same with descriptors of images that show the world mirrored or, with False, as it is.

        Those that do not say are taken to be so; None: all stay as they are.
        """
        if mirrored is None or self.mirrored == mirrored:
            return self
        if self.mirrored is None:
            return replace(self, mirrored=mirrored)
        words = replace(self.words, centres=mirrored_sift(self.words.centres))
        return replace(self, descriptors=mirrored_sift(self.descriptors), words=words, mirrored=mirrored)

    def moved(self, before: Array, after: Array) -> "Landmarks":
        """Each point moved as the references that see it are, from their poses `before` (R, 3) to those `after` (R, 3):
        to the mean of where they see it then. Deviations of the poses turn with them."""
        owners = np.repeat(np.arange(self.references), np.diff(self.starts))
        x, y = (self.points[self.seen, :2] - before[owners, :2]).T
        cos, sin = np.cos((after - before)[owners, 2]), np.sin((after - before)[owners, 2])
        counts, points = np.bincount(self.seen, minlength=len(self)), self.points.copy()
        seen = counts > 0
        for axis, turned in enumerate((cos * x - sin * y, sin * x + cos * y)):
            total = np.bincount(self.seen, after[owners, axis] + turned, len(self))
            points[seen, axis] = total[seen] / counts[seen]
        sigmas = self.pose_sigmas
        if sigmas is not None:
            (x, y, turn), share = sigmas.T**2, np.cos((after - before)[:, 2]) ** 2
            turned_squares = (share * x + (1.0 - share) * y, (1.0 - share) * x + share * y, turn)
            sigmas = np.sqrt(np.column_stack(turned_squares))
        return replace(self, points=points, pose_sigmas=sigmas)


def mirrored_alike(given: Sequence[Landmarks]) -> list[Landmarks]:
    """Landmarks of several maps, with descriptors as of the images of the first that says whether they are mirrored."""
    mirrored = next((each.mirrored for each in given if each.mirrored is not None), None)
    return [each.as_mirrored(mirrored) for each in given]


def stored_descriptors(values: Floats) -> Bytes:
    """Rows (N, D) of length 1 as they are stored, a byte each."""
    return np.asarray(np.clip(np.rint(values * np.float32(DESCRIPTOR_SCALE)), 0, 255).astype(np.uint8), np.uint8)


def restored_descriptors(stored: Bytes) -> Floats:
    """Rows (N, D) of length 1, as they are compared, of those that `stored_descriptors` made."""
    values: Floats = stored.astype(np.float32) / np.float32(DESCRIPTOR_SCALE)
    return values


class LandmarkFix(Value):
    """Poses from which an image may have been taken, each by the landmarks that it saw from there, the best first.

    `poses` (K, 3): x, y (m), heading (rad), map frame. `covariances` (K, 3, 3): m, m, rad. `inliers` (K,): how many
    landmarks agree. `matches`: how many were compared. `probabilities` (K,): that each is right; their sum is at most
    1, and the rest is that none is. `bearings` (M, 3) float32: of the matched features, unit vectors in the robot's
    frame, and `agree` (M,): the pose that each agrees with, -1 for none; None where they were not kept.
    """

    poses: Annotated[Array, Shape("K", 3)]
    covariances: Annotated[Array, Shape("K", 3, 3), Covariances()]
    inliers: Annotated[Ints, Shape("K"), Bounds(ge=0)]
    probabilities: Annotated[Array, Shape("K"), Bounds(ge=0, le=1)]
    matches: Annotated[int, Bounds(ge=0)]
    bearings: Annotated[Floats | None, Shape("M", 3)] = None
    agree: Annotated[npt.NDArray[np.int8] | None, Shape("M"), Bounds(ge=-1)] = None

    def __len__(self) -> int:
        return len(self.poses)

    def without(self, out: Bools) -> "LandmarkFix":
        """The other poses, as probable as without those (K,) that are ruled out."""
        kept = np.flatnonzero(~out)
        numbers = np.full(len(self) + 1, -1, np.int8)  # the last one: none, which stays none
        numbers[kept] = np.arange(len(kept))
        return replace(
            self,
            poses=self.poses[kept],
            covariances=self.covariances[kept],
            inliers=self.inliers[kept],
            probabilities=self.probabilities[kept] / (1.0 - self.probabilities[out].sum()),
            agree=None if self.agree is None else numbers[self.agree],
        )
