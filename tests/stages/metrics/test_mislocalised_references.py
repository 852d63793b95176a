from pathlib import Path

import numpy as np
import pytest
import yaml
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.pipeline.experiment.series import figure_at
from omninav.stages.metrics.mislocalised_references import MislocalisedReferences
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent

KIDNAP = Path(__file__).resolve().parents[3] / "conf" / "experiment" / "particle_cml" / "kidnap.yaml"
CTX = Context("wrong places")
NONE = np.empty(0, np.int64)


def event(inserted=(), removed=(), seen=None):
    came, went = np.array(inserted, np.int64), np.array(removed, np.int64)
    at = came if seen is None else np.array(seen, np.int64)
    return ViewEvent(1, 1, came, at, went, "", came, np.zeros(len(came)), np.zeros((len(came), 2)), came * 0)


def mixture(*parts):
    names, xs, weights = zip(*parts, strict=True)
    means = np.array([(x, 0.0, 0.0) for x in xs], np.float32)
    return MixturesNow(np.array(names, np.int64), means, np.array(weights, np.float32))


def driven(truth):
    return collected([Tick(k, k) for k in range(len(truth))], truth)


@pytest.fixture
def life():
    # The robot goes from x = 0 by 1 m a frame. Reference 0 comes where it is; 1 and 2 come 10 m off.
    events = [event([0]), event([1]), event([2]), event(), event(), event()]
    mixtures = [
        mixture((0, 0.0, 1.0)),
        mixture((1, 11.0, 1.0)),
        mixture((2, 12.0, 1.0)),
        mixture((1, 11.0, 0.5), (1, 1.0, 0.5)),
        mixture((1, 1.0, 1.0)),
        mixture((2, 12.0, 0.2), (2, 2.0, 0.6)),
    ]
    truth = [Pose(float(x), 0.0, 0.0) for x in range(6)]
    return driven(truth), events, mixtures


def test_the_share_of_the_weight_at_a_wrong_place_is_followed_until_it_is_gone(monkeypatch: pytest.MonkeyPatch, life):
    monkeypatch.setattr("omninav.stages.metrics.mislocalised_references.POINTS", 6)
    found = MislocalisedReferences().step(CTX, *life).metrics.values["mislocalised_references"]
    assert found["references"] == 2
    assert found["kept"] == 1
    assert found["along_m"] == [0.0, 1.0]
    assert found["gone_after_steps"] == [3, None]
    assert found["step"] == [0, 1, 2, 3, 4, 5]
    assert found["weight"] == [None, 1.0, 1.0, 0.75, 0.5, pytest.approx(0.125)]
    assert found["example"]["weight"] == [0.0, 1.0, 1.0, 0.5, 0.0, 0.0]


def test_a_reference_that_is_removed_holds_no_place(monkeypatch: pytest.MonkeyPatch, life):
    drive, events, mixtures = life
    events[3] = event(removed=[1, 2])
    mixtures[3:] = [None, None, None]
    monkeypatch.setattr("omninav.stages.metrics.mislocalised_references.POINTS", 6)
    found = MislocalisedReferences().step(CTX, drive, events, mixtures).metrics.values["mislocalised_references"]
    assert found["kept"] == 0
    assert found["gone_after_steps"] == [2, 1]


def test_a_map_without_wrong_places_says_only_that(life):
    drive, events, mixtures = life
    found = MislocalisedReferences().step(CTX, drive.at(slice(1)), events[:1], mixtures[:1]).metrics.values
    assert found == {"mislocalised_references": {"references": 0}}


def test_what_is_learned_late_is_held_against_where_it_was_seen(life):
    drive = life[0]
    late = [event()] * 4 + [event([0], seen=[1]), event()]
    parts = [None] * 4 + [mixture((0, 1.0, 1.0)), None]
    near = MislocalisedReferences().step(CTX, drive, late, parts).metrics.values["mislocalised_references"]
    assert near["references"] == 0


def test_points_lie_along_the_way_where_they_were_seen_however_late_they_came(life):
    late = [event()] * 4 + [event([0, 1], seen=[3, 1]), event()]
    parts = [None] * 4 + [mixture((0, 20.0, 1.0), (1, 20.0, 1.0)), None]
    found = MislocalisedReferences().step(CTX, life[0], late, parts).metrics.values["mislocalised_references"]
    assert found["along_m"] == [0.0, 2.0]


def corrected(later_by_a_lap_each: int, points: int = 12, laps: int = 9):
    """A lap of 40 frames, points seen in every second one: wrong for 3 laps, a lap longer after each so many points."""
    events, mixtures = [event()] * (40 * laps), [None] * (40 * laps)
    for point in range(points):
        for lap in range(laps):
            frame = 40 * lap + 10 + 2 * point
            wrong = lap < 3 + point // later_by_a_lap_each
            events[frame] = event([point], seen=[frame]) if lap == 0 else event()
            mixtures[frame] = mixture((point, 50.0 if wrong else 2.0 * point, 1.0))
    truth = [Pose(float(frame % 40 - 10), 0.0, 0.0) for frame in range(40 * laps)]
    return MislocalisedReferences().step(CTX, driven(truth), events, mixtures).metrics.values


def test_the_measure_of_the_order_of_correction_is_0_where_all_are_corrected_alike_and_positive_where_it_travels():
    entries = yaml.safe_load(KIDNAP.read_text())["measures"]
    order, kept = ((entries[name]["path"][0], entries[name].get("aggregate", "mean")) for name in ("order", "kept"))
    assert figure_at(corrected(99), *order) == pytest.approx(0.0, abs=1e-9)
    assert figure_at(corrected(4), *order) == pytest.approx(40 / 4, rel=0.15)
    some_stay = corrected(2, laps=7)
    assert figure_at(some_stay, *kept) == 4
    assert figure_at(some_stay, *order) == pytest.approx(40 / 2, rel=0.15)


def test_a_place_is_wrong_beyond_two_metres():
    truth = driven([Pose(0.0, 0.0, 0.0)] * 2)
    events = [event([0, 1, 2], seen=[0, 0, 0]), event()]
    parts = [mixture((0, 1.9, 1.0), (1, 2.0, 1.0), (2, 2.1, 1.0)), None]
    found = MislocalisedReferences().step(CTX, truth, events, parts).metrics.values["mislocalised_references"]
    assert (found["references"], found["kept"]) == (1, 1)


def test_what_was_not_seen_on_this_drive_or_where_no_truth_is_does_not_count(monkeypatch: pytest.MonkeyPatch):
    truth = driven([None, Pose(0.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0)])
    events = [event([1], seen=[0]), event([2], seen=[1]), event()]
    parts = [mixture((0, 50.0, 1.0), (1, 50.0, 1.0)), mixture((0, 50.0, 1.0), (1, 50.0, 1.0), (2, 50.0, 1.0)), None]
    monkeypatch.setattr("omninav.stages.metrics.mislocalised_references.POINTS", 3)
    found = MislocalisedReferences().step(CTX, truth, events, parts).metrics.values["mislocalised_references"]
    assert found["references"] == 1
    assert found["weight"] == [None, 1.0, 1.0]


def test_a_reference_without_any_weight_holds_no_place(monkeypatch: pytest.MonkeyPatch, life):
    events, parts = [event([0]), *[event()] * 5], [mixture((0, 9.0, 1.0)), mixture((0, 9.0, 0.0)), *[None] * 4]
    monkeypatch.setattr("omninav.stages.metrics.mislocalised_references.POINTS", 6)
    found = MislocalisedReferences().step(CTX, life[0], events, parts).metrics.values["mislocalised_references"]
    assert found["weight"] == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert found["gone_after_steps"] == [1]


def test_how_long_a_place_stayed_is_counted_from_where_it_came_and_not_from_where_it_was_seen(life):
    late = [event(), event(), event([0, 1], seen=[1, 0]), *[event()] * 3]
    parts = [None, None, mixture((0, 20.0, 1.0), (1, 20.0, 1.0)), None, mixture((0, 1.0, 1.0), (1, 20.0, 1.0)), None]
    found = MislocalisedReferences().step(CTX, life[0], late, parts).metrics.values["mislocalised_references"]
    assert found["along_m"] == [0.0, 1.0]  # 1 was seen before 0
    assert found["gone_after_steps"] == [None, 2]
    assert len(found["step"]) == 6
    assert found["weight"][:3] == [None, None, 1.0]


def test_a_mixture_is_wrong_where_its_heaviest_place_is():
    truth = driven([Pose(0.0, 0.0, 0.0)] * 2)
    parts = [mixture((0, 0.0, 0.6), (0, 9.0, 0.4), (1, 0.0, 0.25), (1, 9.0, 0.75)), None]
    found = (
        MislocalisedReferences()
        .step(CTX, truth, [event([0, 1], seen=[0, 0]), event()], parts)
        .metrics.values["mislocalised_references"]
    )
    assert found["references"] == 1
    assert found["weight"] == [0.75, 0.75]


def test_the_lists_over_the_frames_have_sixty_entries_from_the_first_to_the_last():
    truth = driven([Pose(0.0, 0.0, 0.0)] * 200)
    events, parts = [event([0]), *[event()] * 199], [mixture((0, 9.0, 1.0)), *[None] * 199]
    found = MislocalisedReferences().step(CTX, truth, events, parts).metrics.values["mislocalised_references"]
    assert (len(found["step"]), found["step"][0], found["step"][-1]) == (60, 0, 199)
