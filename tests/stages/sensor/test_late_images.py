"""The delay of a drive's images, by headings that landmarks show of a robot that swings from side to side."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.sensor.late_images import EVERY, MAX_IMAGES, MIN_CHANGE_S, LateImages

SIGMA, ODOMETRY = math.radians(0.1), 0.02


def heading(seconds: np.ndarray) -> np.ndarray:
    return 0.05 * seconds + 0.8 * np.sin(0.5 * seconds) + 0.3 * np.sin(1.1 * seconds)


def driven(delay: float, seed: int = 0, images: int = 160, interval: float = 0.5, allowed: float = 0.0) -> LateImages:
    """Adds so many images, stamped late by `delay`; one in five shows no landmarks."""
    rng, late = np.random.default_rng(seed), LateImages()
    stamps = 100.0 + interval * np.arange(images)
    turns = np.diff(heading(stamps), prepend=heading(stamps[:1])) * (1.0 + rng.normal(0.0, ODOMETRY, images))
    for stamp, turn in zip(stamps, turns, strict=True):
        late = late.driven(float(turn), interval)
        if rng.uniform() > 0.2:
            seen = float(wrap(1.0 + heading(stamp - delay) + rng.normal(0.0, SIGMA)))
            late = late.seen(seen, late.allowed(allowed))
    return late


@pytest.mark.parametrize("interval", [0.5, 0.1])
@pytest.mark.parametrize("delay", [0.1, 0.25, -0.15])
def test_the_delay_is_found(delay: float, interval: float) -> None:
    found = [driven(delay, seed, int(80.0 / interval), interval).delay_s for seed in range(4)]
    assert found == pytest.approx([delay] * 4, abs=0.015)


def test_images_in_time_and_those_that_are_as_late_as_is_allowed_for_show_none() -> None:
    assert np.isnan([driven(0.0, seed).delay_s for seed in range(8)]).all()
    assert np.isnan([driven(0.2, seed, allowed=0.2).delay_s for seed in range(8)]).all()
    assert driven(0.0, allowed=0.2).delay_s == pytest.approx(0.0, abs=0.015)


def test_few_images_and_a_robot_that_drives_straight_ahead_show_none() -> None:
    assert math.isnan(driven(0.2, images=40).delay_s)
    late, rng = LateImages(), np.random.default_rng(0)
    for _ in range(200):
        late = late.driven(float(rng.normal(0.0, 0.001)), 0.5).seen(float(rng.normal(0.0, SIGMA)), 0.0)
    assert math.isnan(late.delay_s)


def test_images_in_quick_succession_are_thinned_and_old_ones_forgotten() -> None:
    late = driven(0.1, images=900, interval=0.1)
    assert np.diff(late.rows[:, 0]).min() == pytest.approx(0.2)
    long = driven(0.1, images=MAX_IMAGES + 40)
    assert len(long.rows) == MAX_IMAGES
    assert long.rows[-1, 0] - long.rows[0, 0] == pytest.approx(0.5 * (MAX_IMAGES - 1))


def test_a_search_waits_for_further_images_and_follows_once_it_has_found_a_delay() -> None:
    late = driven(0.1)
    assert late.unsearched < EVERY
    again = late
    for stamp in 180.0 + 0.5 * np.arange(200):  # the clock is set: images are later than before
        turn = heading(np.array([stamp - 0.5, stamp]))
        again = again.driven(float(turn[1] - turn[0]), 0.5)
        again = again.seen(float(wrap(1.0 + heading(stamp - 0.1 - MIN_CHANGE_S))), again.delay_s)
    assert again.delay_s > late.delay_s + 0.3 * MIN_CHANGE_S


@pytest.mark.parametrize("noise", [0.0, 0.0005])
@pytest.mark.parametrize("interval", [0.5, 0.2])
def test_a_robot_that_stands_or_drives_straight_keeps_the_delay_that_its_turns_showed(
    noise: float, interval: float
) -> None:
    late, rng = driven(0.1, images=int(80.0 / interval), interval=interval), np.random.default_rng(0)
    found = late.delay_s
    for _ in range(int(300.0 / interval)):
        late = late.driven(float(rng.normal(0.0, noise)), interval)
        late = late.seen(float(wrap(1.0 + heading(80.0) + rng.normal(0.0, SIGMA))), late.allowed(0.0))
        assert late.delay_s == pytest.approx(found, abs=0.02)


def test_a_delay_that_was_found_outlasts_an_image_without_motion() -> None:
    late = driven(0.1).interrupted()
    assert (late.delay_s, len(late.rows)) == (pytest.approx(0.1, abs=0.015), 0)
