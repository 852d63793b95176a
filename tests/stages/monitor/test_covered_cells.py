"""Parts of panoramas that a robot's own body covers."""

import numpy as np

from omninav.stages.monitor.covered_cells import MIN_IMAGES, CoveredCells


def test_what_changes_little_while_the_rest_does_is_covered() -> None:
    rng, covered = np.random.default_rng(0), CoveredCells()
    strips = rng.uniform(0.0, 255.0, (40, 8, 90)).astype(np.float32)
    strips[:, 4:, 30:60] = 100.0 + 0.1 * strips[:, 4:, 30:60]  # a body in the light of its surroundings
    for number, strip in enumerate(strips):
        assert number >= MIN_IMAGES or not covered.cells().any()
        covered = covered.seen(strip)
    expected = np.zeros((8, 90), np.bool_)
    expected[4:, 30:60] = True
    np.testing.assert_array_equal(covered.cells(), expected)
    shown = covered.uncovered(strips)
    np.testing.assert_array_equal(shown[:, ~expected], strips[:, ~expected])
    rest = np.delete(strips[:, 5], np.s_[30:60], axis=1).mean(axis=1)
    np.testing.assert_allclose(shown[:, 5, 30:60], np.repeat(rest[:, None], 30, axis=1), rtol=1e-5)
    np.testing.assert_allclose(np.sqrt(covered.variance), strips.std(axis=0), rtol=1e-4)


def test_a_cover_that_was_taken_off_and_one_that_was_put_on_are_told_of_late_images() -> None:
    rng, covered = np.random.default_rng(0), CoveredCells()
    for number in range(600):
        strip = rng.uniform(0.0, 255.0, (8, 90)).astype(np.float32)
        strip[:, :30] = np.where(number < 200, 90.0, strip[:, :30])
        strip[:, 60:] = np.where(number < 200, strip[:, 60:], 90.0)
        covered = covered.seen(strip)
    assert covered.cells()[:, 60:].all()
    assert not covered.cells()[:, :60].any()


def test_a_robot_that_stands_and_another_camera_show_no_cover() -> None:
    rng, covered = np.random.default_rng(0), CoveredCells()
    for _ in range(40):
        covered = covered.seen((100.0 + rng.normal(size=(8, 90))).astype(np.float32))
    assert not covered.cells().any()
    other = np.zeros((2, 4, 36), np.float32)
    assert covered.uncovered(other) is other
    assert covered.seen(other[0]).images == 1
