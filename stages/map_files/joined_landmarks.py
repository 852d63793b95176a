"""Landmarks of several maps in one."""

import math
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput
from omninav.stages.geometry.appearance.visual_words import learned_words
from omninav.stages.geometry.arrays import Bytes, Ints
from omninav.stages.values.landmarks import Landmarks, mirrored_alike, restored_descriptors
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords, words_of_roots

DESCRIPTORS_PER_WORD = 16
"""Landmarks' descriptors that a vocabulary is learned from, for each word."""


def joined_landmarks(maps: Sequence[ReferenceGraph]) -> Landmarks | None:
    """Landmarks of the references of several maps, in their order; None where no map has any.

    References of a map without landmarks see none. Maps of one vocabulary keep their words. Those of several share one
    that is learned from all their landmarks, and the words of a reference are then those of the landmarks that it sees:
    what else its image held is not in a map. Raises BadInput where descriptors are of different lengths.
    """
    given = [map.landmarks for map in maps if map.landmarks is not None]
    if not given:
        return None
    widths = {each.descriptors.shape[1] for each in given if len(each)}
    if len(widths) > 1:
        raise BadInput(
            f"maps: descriptors of their landmarks have {' and '.join(map(str, sorted(widths)))} numbers, expected one "
            "length; learn the maps with the same features"
        )
    parts = mirrored_alike([_of_all(map, given[0]) for map in maps])
    points = np.cumsum([0, *(len(each) for each in parts)])
    starts = np.cumsum([0, *(len(each.seen) for each in parts)])
    descriptors = np.concatenate([each.descriptors for each in parts if len(each)] or [parts[0].descriptors])
    seen = np.concatenate([each.seen + first for each, first in zip(parts, points, strict=False)]).astype(np.int32)
    ends = np.concatenate([[0], *(each.starts[1:] + first for each, first in zip(parts, starts, strict=False))])
    # A camera that is described rightly needs no correction: that of another description is kept for drives with it.
    corrected = next((each for each in given if _is_corrected(each)), given[0])
    variances = [each.sigma_rad**2 for each in given]
    return Landmarks(
        np.concatenate([each.points for each in parts]),
        descriptors,
        ends.astype(np.int64),
        seen,
        math.sqrt(float(np.average(variances, weights=[len(each) + 1 for each in given]))),
        _joined_words([each.words for each in parts]) or _words_of_landmarks(given, descriptors, ends, seen),
        min(each.found_rate for each in given),
        variance_factor=max(each.variance_factor for each in given),
        described=corrected.described,
        mount=corrected.mount,
        described_delay_s=corrected.described_delay_s,
        delay_s=corrected.delay_s,
        pose_sigmas=np.concatenate(
            [np.zeros((len(each.starts) - 1, 3)) if each.pose_sigmas is None else each.pose_sigmas for each in parts]
        ),
        mirrored=parts[0].mirrored,
    )


def _is_corrected(landmarks: Landmarks) -> bool:
    """Tells whether a tour's camera sat, or lagged, otherwise than described."""
    return bool((landmarks.mount != landmarks.described).any()) or landmarks.delay_s != landmarks.described_delay_s


def _of_all(map: ReferenceGraph, other: Landmarks) -> Landmarks:
    """A map's landmarks with an entry for each of its references; none of a map without."""
    if map.landmarks is None:
        return other.of_references(np.full(len(map), other.references))
    return map.landmarks.of_references(np.arange(len(map)))


def _joined_words(words: Sequence[VisualWords]) -> VisualWords | None:
    """The words of all where they are of one vocabulary, else None."""
    first = words[0]
    if any(not np.array_equal(first.centres, each.centres) for each in words[1:]):
        return None
    starts = np.cumsum([0, *(len(each.words) for each in words)])
    return VisualWords(
        first.centres,
        first.rarity,
        np.concatenate([[0], *(each.starts[1:] + s for each, s in zip(words, starts, strict=False))]).astype(np.int64),
        np.concatenate([each.words for each in words]),
        np.concatenate([each.weights for each in words]),
    )


def _words_of_landmarks(
    given: Sequence[Landmarks], descriptors: Bytes, starts: Ints, seen: npt.NDArray[np.int32]
) -> VisualWords:
    number = max(len(each.words.centres) for each in given)
    values = restored_descriptors(descriptors)
    sample = np.linspace(0, max(len(values) - 1, 0), min(len(values), number * DESCRIPTORS_PER_WORD)).astype(np.int64)
    centres = learned_words(values[sample], number)
    return words_of_roots((values[seen[a:b]] for a, b in pairwise(starts.tolist())), centres)
