"""The map of topological_nav as a user learns it: a map of a furnished house, which grows from a second drive."""

import json
from pathlib import Path

import numpy as np
from conftest import DATA, DRIVE, TOUR, needs_data

HOUSE = DATA / "photoreal-house"


def test_a_drive_on_another_day_is_recognised_in_the_map_of_a_tour(omninav, tmp_path: Path):
    words = ("map", "variant=topological_nav", "nodes.source.stride=2")
    omninav(*words, f"log={TOUR}", check=True)
    first = (tmp_path / "runs" / "latest").resolve()
    metrics = json.loads((first / "metrics.json").read_text())
    assert metrics["loops"]["accepted"] == 0  # no place is seen twice on the tour
    assert 15 < metrics["map"]["places"] < 37
    omninav(*words, f"log={DRIVE}", f"map={first}/map.omap", check=True)
    again = json.loads((tmp_path / "runs" / "latest" / "metrics.json").read_text())
    assert again["loops"]["wrong"] == 0
    assert again["loops"]["accepted"] > 5
    assert again["loops"]["recall"] > 0.8


@needs_data
def test_a_house_becomes_places_and_a_second_drive_adds_to_them(omninav, tmp_path: Path):
    words = ("map", "variant=topological_nav", f"log={HOUSE}/tour.mcap", "nodes.source.stride=4")
    omninav(*words, check=True)
    first = (tmp_path / "runs" / "latest").resolve()
    metrics = json.loads((first / "metrics.json").read_text())
    assert metrics["loops"]["wrong"] == 0
    assert metrics["loops"]["accepted"] >= 2
    assert 20 < metrics["map"]["places"] < 60
    assert metrics["map"]["place_size_bytes"] < 1.68e6 / 59
    assert metrics["map"]["step_m"]["max"] < 5.0
    assert "Loop hypotheses and the topological map" in (first / "report.html").read_text()

    omninav(*words[:2], f"log={HOUSE}/drive.mcap", f"map={first}/map.omap", words[-1], check=True)
    second = (tmp_path / "runs" / "latest").resolve()
    grown = json.loads((second / "metrics.json").read_text())
    assert grown["loops"]["wrong"] == 0
    assert grown["map"]["places"] >= metrics["map"]["places"]
    assert grown["map"]["links"] > metrics["map"]["links"]
    assert np.isfinite(grown["map"]["step_m"]["max"])
