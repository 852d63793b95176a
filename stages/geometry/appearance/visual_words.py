"""Visual words: local descriptors by the nearest of a few thousand learned ones, and views by which words they hold."""

import warnings

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Floats, Ints

ITERATIONS = 8
"""Iterations of k-means; more change the nearest image by less than a centimetre."""


def root_descriptors(descriptors: npt.ArrayLike) -> Floats:
    """Square roots of descriptors (N, D) that are brought to sum 1: rows of length 1, compared by Hellinger's distance.

    RootSIFT (Arandjelovic & Zisserman 2012). Zeros stay zeros.
    """
    values = np.asarray(descriptors, np.float32)
    total = values.sum(axis=1, keepdims=True)
    return np.asarray(np.sqrt(values / np.where(total > 0.0, total, np.float32(1.0))), np.float32)


def learned_words(descriptors: Floats, number: int) -> Floats:
    """Centres (K, D) of descriptors (N, D) by k-means; K is `number`, or less where fewer descriptors differ.

    It starts with descriptors at even steps in their order, so that the same descriptors give the same words.
    """
    from scipy.cluster.vq import kmeans2  # slow to import, and seldom needed

    distinct, first = np.unique(descriptors, axis=0, return_index=True)
    if len(distinct) <= number:
        return distinct
    rows = np.sort(first)[np.linspace(0, len(distinct) - 1, number).astype(np.int64)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a centre that no descriptor is nearest to stays where it is
        centres, _ = kmeans2(descriptors, descriptors[rows], iter=ITERATIONS, minit="matrix")
    return np.asarray(centres, np.float32)


def word_counts(descriptors: Floats, centres: Floats) -> tuple[Ints, Floats]:
    """Which words a view's descriptors (N, D) are nearest to, ascending, and how many to each: (W,) and (W,)."""
    if not len(descriptors) or not len(centres):
        return np.empty(0, np.int64), np.empty(0, np.float32)
    nearest = (descriptors @ centres.T - 0.5 * np.einsum("kd,kd->k", centres, centres)).argmax(axis=1)
    words, counts = np.unique(nearest, return_counts=True)
    return words.astype(np.int64), counts.astype(np.float32)


def rarity(document_frequency: npt.NDArray[np.integer], documents: int) -> Floats:
    """Weight (K,) of each word by the number of views that have it: log(1 + views / its views), 0 for none.

    The inverse document frequency of text retrieval (Sivic & Zisserman 2003), with a 1 so that a map of one view has
    weights too.
    """
    each = np.asarray(document_frequency, np.float64)
    weights = np.log1p(documents / np.maximum(each, 1.0))
    return np.where(each > 0.0, weights, 0.0).astype(np.float32)


def weighted(words: Ints, counts: Floats, rarity: Floats) -> Floats:
    """Weights (W,) of a view's words, of length 1 together: the square root of the count, so that what repeats itself
    (grass, tiles) does not outweigh all else, times the rarity."""
    values = np.sqrt(counts) * rarity[words]
    length = float(np.linalg.norm(values))
    return values if length == 0.0 else np.asarray(values / np.float32(length), np.float32)
