import numpy as np
import pytest
from measured_drives import AT_ORIGIN, Row, figures, made_drive, on_x

from omninav.stages.metrics.mislocalised_references import MislocalisedReferences
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent


def event(inserted=(), removed=(), seen=None):
    came, went = np.array(inserted, np.int64), np.array(removed, np.int64)
    at = came if seen is None else np.array(seen, np.int64)
    return ViewEvent(1, 1, came, at, went, "", came, np.zeros(len(came)), np.zeros((len(came), 2)), came * 0)


def mixture(*parts):
    names, xs, weights = zip(*parts, strict=True)
    means = np.array([(x, 0.0, 0.0) for x in xs], np.float32)
    return MixturesNow(np.array(names, np.int64), means, np.array(weights, np.float32))


def followed(truth: list[Row], events, mixtures):
    return figures(MislocalisedReferences(), made_drive(truth), events, mixtures)["mislocalised_references"]


WAY = on_x(range(6))
"""The robot goes from x = 0 by 1 m a frame."""
ONE_BY_ONE = [event([0]), event([1]), event([2]), event(), event(), event()]
"""Reference 0 comes where it is; 1 and 2 come 10 m off."""
MIXTURES = [
    mixture((0, 0.0, 1.0)),
    mixture((1, 11.0, 1.0)),
    mixture((2, 12.0, 1.0)),
    mixture((1, 11.0, 0.5), (1, 1.0, 0.5)),
    mixture((1, 1.0, 1.0)),
    mixture((2, 12.0, 0.2), (2, 2.0, 0.6)),
]


def test_the_share_of_the_weight_at_a_wrong_place_is_followed_until_it_is_gone():
    steps = [0, 1, 2, 3, 4, 5]
    assert followed(WAY, ONE_BY_ONE, MIXTURES) == {
        "references": 2,
        "kept": 1,
        "along_m": [0.0, 1.0],
        "gone_after_steps": [3, None],
        "step": steps,
        "weight": [None, 1.0, 1.0, 0.75, 0.5, pytest.approx(0.125)],
        "example": {"step": steps, "weight": [0.0, 1.0, 1.0, 0.5, 0.0, 0.0]},
    }


def test_a_reference_that_is_removed_holds_no_place():
    events = [*ONE_BY_ONE[:3], event(removed=[1, 2]), event(), event()]
    found = followed(WAY, events, [*MIXTURES[:3], None, None, None])
    assert (found["kept"], found["gone_after_steps"]) == (0, [2, 1])


def test_a_map_without_wrong_places_says_only_that():
    assert followed(WAY[:1], ONE_BY_ONE[:1], MIXTURES[:1]) == {"references": 0}


def test_what_is_learned_late_is_held_against_where_it_was_seen():
    late = [event()] * 4 + [event([0], seen=[1]), event()]
    assert followed(WAY, late, [None] * 4 + [mixture((0, 1.0, 1.0)), None])["references"] == 0


def test_a_place_is_wrong_beyond_two_metres():
    parts = [mixture((0, 1.9, 1.0), (1, 2.0, 1.0), (2, 2.1, 1.0)), None]
    found = followed([AT_ORIGIN] * 2, [event([0, 1, 2], seen=[0, 0, 0]), event()], parts)
    assert (found["references"], found["kept"]) == (1, 1)


def test_what_was_not_seen_on_this_drive_or_where_no_truth_is_does_not_count():
    events = [event([1], seen=[0]), event([2], seen=[1]), event()]
    parts = [mixture((0, 50.0, 1.0), (1, 50.0, 1.0)), mixture((0, 50.0, 1.0), (1, 50.0, 1.0), (2, 50.0, 1.0)), None]
    found = followed([None, AT_ORIGIN, AT_ORIGIN], events, parts)
    assert (found["references"], found["weight"]) == (1, [None, 1.0, 1.0])


def test_a_reference_without_any_weight_holds_no_place():
    parts = [mixture((0, 9.0, 1.0)), mixture((0, 9.0, 0.0)), *[None] * 4]
    found = followed(WAY, [event([0]), *[event()] * 5], parts)
    assert (found["weight"], found["gone_after_steps"]) == ([1.0, 0.0, 0.0, 0.0, 0.0, 0.0], [1])


def test_how_long_a_place_stayed_is_counted_from_where_it_came_and_not_from_where_it_was_seen():
    late = [event(), event(), event([0, 1], seen=[1, 0]), *[event()] * 3]
    parts = [None, None, mixture((0, 20.0, 1.0), (1, 20.0, 1.0)), None, mixture((0, 1.0, 1.0), (1, 20.0, 1.0)), None]
    found = followed(WAY, late, parts)
    assert found["along_m"] == [0.0, 1.0]  # 1 was seen before 0
    assert found["gone_after_steps"] == [None, 2]
    assert found["weight"][:3] == [None, None, 1.0]


def test_a_mixture_is_wrong_where_its_heaviest_place_is():
    parts = [mixture((0, 0.0, 0.6), (0, 9.0, 0.4), (1, 0.0, 0.25), (1, 9.0, 0.75)), None]
    found = followed([AT_ORIGIN] * 2, [event([0, 1], seen=[0, 0]), event()], parts)
    assert (found["references"], found["weight"]) == (1, [0.75, 0.75])


def test_the_lists_over_the_frames_have_sixty_entries_from_the_first_to_the_last():
    found = followed([AT_ORIGIN] * 200, [event([0]), *[event()] * 199], [mixture((0, 9.0, 1.0)), *[None] * 199])
    assert (len(found["step"]), found["step"][0], found["step"][-1]) == (60, 0, 199)
