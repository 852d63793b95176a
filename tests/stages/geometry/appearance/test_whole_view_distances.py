"""Distances and turns between whole views, against sums and signals written out."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.stages.geometry.appearance.rotated_distances import all_distances, turned_distances, turns_of_nearest
from omninav.stages.geometry.appearance.spectra import best_turns, packed, spectral_distances, unpacked

RNG = np.random.default_rng(3)


def test_distance_at_the_best_heading_is_the_least_of_all_written_out() -> None:
    turned = RNG.normal(0, 100, (2, 64)).astype(np.float32)
    kept = np.concatenate([RNG.normal(0, 100, (50, 64)), turned[[1]] + 1e-3, turned[[0]]]).astype(np.float32)
    written = np.array([[math.dist(here, there) for here in turned.tolist()] for there in kept.tolist()])
    assert all_distances(turned, kept) == pytest.approx(written, rel=1e-6, abs=1e-2)
    found = turned_distances(turned, kept)
    assert found == pytest.approx(written.min(axis=1), rel=1e-5)
    assert found[-1] == 0.0


def test_between_headings_the_distance_follows_the_parabola_of_squares() -> None:
    turned = RNG.normal(0, 100, (36, 64)).astype(np.float32)
    kept = np.concatenate([RNG.normal(0, 100, (50, 64)), turned[[20]]]).astype(np.float32)
    found = turned_distances(turned, kept)
    for there, distance in zip(kept.tolist(), found.tolist(), strict=True):
        squares = [math.dist(here, there) ** 2 for here in turned.tolist()]
        best = int(np.argmin(squares))
        around = [squares[(best + step) % 36] for step in (-1, 0, 1)]
        bend, slope, level = np.polyfit([-1, 0, 1], around, 2)
        assert distance == pytest.approx(math.sqrt(max(0.0, level - slope**2 / (4 * bend))), rel=1e-4, abs=1e-3)
    assert found[-1] == 0.0


@pytest.mark.parametrize("headings", [12, 36, 72])
@pytest.mark.parametrize("turn", [0.0, 0.3, -1.9, 3.1])
def test_a_view_that_turns_with_the_robot_tells_by_how_much(headings: int, turn: float) -> None:
    """A vector on a circle: seen by a robot turned by t, its angle is t more."""
    angles = turn + 2 * math.pi * np.arange(headings) / headings
    turned = np.stack([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)
    found = turns_of_nearest(turned, np.array([[1.0, 0.0]], np.float32))
    assert found == pytest.approx([math.remainder(turn, 2 * math.pi)], abs=3e-3)  # of the parabola, at 12 headings


def test_one_heading_knows_no_turn() -> None:
    assert turns_of_nearest(np.ones((1, 4), np.float32), np.zeros((5, 4), np.float32)).tolist() == [0.0] * 5


def spectrum(signal: np.ndarray) -> np.ndarray:
    return packed(np.fft.rfft(signal, axis=1) / np.sqrt(signal.shape[1]))


def test_packing_loses_nothing_but_precision() -> None:
    values = RNG.normal(size=(3, 7)) + 1j * RNG.normal(size=(3, 7))
    assert unpacked(packed(values), 3) == pytest.approx(values, rel=1e-6)


@given(st.integers(0, 35), st.sampled_from([35, 36]))
def test_spectra_of_a_turned_robot_are_at_distance_zero_and_tell_the_turn(moved: int, segments: int) -> None:
    signal = np.random.default_rng(moved).normal(0, 50, (2, segments))
    turned = np.roll(signal, moved, axis=1)  # columns run clockwise: a counter-clockwise turn moves them on
    here, kept = spectrum(turned), spectrum(signal)[None]
    assert spectral_distances(here, kept, 2, segments)[0] < 1e-3
    expected = math.remainder(2 * math.pi * moved / segments, 2 * math.pi)
    found = best_turns(here, kept, 2, segments)[0]
    assert abs(math.remainder(found - expected, 2 * math.pi)) < math.radians(0.1)


@pytest.mark.parametrize("segments", [9, 10])
def test_the_spectral_distance_is_that_of_signals_without_phases(segments: int) -> None:
    """Parseval: signals whose coefficients are the sizes, all in phase, differ by the same sum of squares."""
    a, b = RNG.normal(size=(2, 3, segments))
    flat = [np.fft.irfft(np.abs(np.fft.rfft(signal, axis=1)), n=segments, axis=1) for signal in (a, b)]
    expected = np.sqrt(((flat[0] - flat[1]) ** 2).sum())
    assert spectral_distances(spectrum(a), spectrum(b)[None], 3, segments) == pytest.approx([expected], rel=1e-5)
    assert expected <= np.sqrt(((a - b) ** 2).sum())


def test_the_turn_is_the_best_circular_correlation_of_the_signals() -> None:
    a, b = RNG.normal(size=(2, 4, 36))
    correlation = [float((a * np.roll(b, moved, axis=1)).sum()) for moved in range(36)]
    off = (
        best_turns(spectrum(a), spectrum(b)[None], 4, 36, steps=36)[0] - 2 * math.pi * int(np.argmax(correlation)) / 36
    )
    assert abs(math.remainder(off, 2 * math.pi)) < math.pi / 36 + 1e-9
