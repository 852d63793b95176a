"""The map of topological_nav as a user learns it, and a second drive in it."""

import json
from pathlib import Path

from conftest import DRIVE, TOUR


def test_a_drive_on_another_day_is_recognised_in_the_map_of_a_tour(omninav, tmp_path: Path):
    words = ("map", "variant=topological_nav", "nodes.source.stride=2")
    omninav(*words, f"log={TOUR}", check=True)
    first = (tmp_path / "runs" / "latest").resolve()
    metrics = json.loads((first / "metrics.json").read_text())
    assert metrics["loops"]["accepted"] == 0  # no place is seen twice on the tour
    assert 15 < metrics["map"]["places"] < 37
    assert "Loop hypotheses and the topological map" in (first / "report.html").read_text()
    omninav(*words, f"log={DRIVE}", f"map={first}/map.omap", check=True)
    again = json.loads((tmp_path / "runs" / "latest" / "metrics.json").read_text())
    assert again["loops"]["wrong"] == 0
    assert again["loops"]["accepted"] > 5
    assert again["loops"]["recall"] > 0.8
