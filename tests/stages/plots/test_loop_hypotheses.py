"""The making of a topological map, drawn and measured."""

from pathlib import Path

import numpy as np
import pytest
from made_places import made_map
from made_tour import Landmarks, along, mapped, scattered

from omninav.pipeline import Context
from omninav.pipeline.engine.artifact import write_artifact
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.metrics.loop_closures import (
    LoopClosures,
    at_supports,
    counted,
    hypothesis_gaps,
    parts_of,
    path_steps,
)
from omninav.stages.plots.loop_hypotheses import ShowLoopHypotheses

CTX = Context("view")


@pytest.fixture(scope="module")
def made() -> TopologicalMapping.Out:
    way = [(5.0, 5.0), (20.0, 5.0), (20.0, 9.0), (5.0, 9.0), (5.0, 5.0), (20.0, 5.0)]
    return mapped(Landmarks(scattered(25.0, 14.0, 400)), [along(way, 1.2)])


def test_hypotheses_and_map_are_drawn_the_same_every_time(made: TopologicalMapping.Out) -> None:
    one, other = (ShowLoopHypotheses().step(CTX, made.hypotheses, made.map).figure for _ in range(2))
    assert one.content == other.content
    accepted = int(made.hypotheses.accepted.sum())
    drawn = one.content.decode()
    assert f"accepted ({accepted})" in drawn
    assert f"places ({len(made.map)})" in drawn
    assert f"{accepted} of {len(made.hypotheses.accepted)} hypotheses" in one.caption
    assert f"{len(made.map)} places" in one.caption


def test_precision_and_recall_are_shares_of_what_was_accepted_and_of_what_is_right() -> None:
    accepted, right = np.array([True, True, True, False, False]), np.array([True, True, False, True, False])
    shares = {"precision": 2 / 3, "recall": 2 / 3}
    assert counted(accepted, right) == {"hypotheses": 5, "accepted": 3, "rejected": 2, "wrong": 1} | shares
    assert counted(accepted, None)["recall"] is None
    assert counted(accepted[:0], right[:0])["precision"] is None


def test_what_another_threshold_of_support_would_accept_is_told() -> None:
    found = at_supports(np.array([0.9, 0.62, 0.3]), np.array([True, False, True]))
    at = {support: k for k, support in enumerate(found["support"])}
    assert [found["accepted"][at[s]] for s in (0.05, 0.3, 0.6, 0.65, 0.95)] == [3, 2, 2, 1, 0]
    assert [found["wrong"][at[s]] for s in (0.05, 0.65)] == [1, 0]
    assert found["precision"][at[0.95]] is None


def test_a_map_is_as_large_as_its_file_and_its_steps_are_those_of_its_ways(
    made: TopologicalMapping.Out, tmp_path: Path
) -> None:
    write_artifact(tmp_path / "map.omap", made.map)
    values = LoopClosures().step(CTX, made.hypotheses, made.map).metrics.values
    assert values["map"]["size_bytes"] == (tmp_path / "map.omap").stat().st_size
    assert values["map"]["places"] == len(made.map)
    assert values["loops"]["hypotheses"] == len(hypothesis_gaps(made.hypotheses))
    merged = values["loops"]["merged"]  # through third ones too, so never fewer than were accepted themselves
    assert merged["hypotheses"] == values["loops"]["loop_closures"]["hypotheses"]
    assert merged["accepted"] >= values["loops"]["loop_closures"]["accepted"] > 0
    one, other = made.map.links[0]
    way = made.map.poses[[made.map.places[one], *made.map.path_of(0), made.map.places[other]], :2]
    assert path_steps(made.map)[: len(way) - 1] == pytest.approx(np.hypot(*np.diff(way, axis=0).T))


def test_without_truth_nothing_is_said_of_right_and_wrong() -> None:
    tour = along([(5.0, 5.0), (20.0, 5.0)], 1.5)
    out = mapped(Landmarks(scattered(25.0, 10.0, 300)), [tour], truth=False)
    values = LoopClosures().step(CTX, out.hypotheses, out.map).metrics.values
    assert values["loops"]["precision"] is None
    assert values["map"]["pose_source"] == "odometry"


def test_parts_are_those_that_no_link_joins() -> None:
    spots = [(float(x), 0.0) for x in range(5)]
    assert parts_of(made_map(spots, {(0, 1): 0, (1, 2): 0, (3, 4): 1})) == 2
    assert parts_of(made_map(spots, {(0, 1): 0, (1, 2): 0, (2, 3): 0, (4, 3): 1})) == 1
