from pathlib import Path

import pytest
from conflicting_logs import AT_TWO_HERTZ, CASES, Case, as_is, found, learned
from conftest import DATA, DRIVE, TOUR, needs_data

from omninav.stages.values.maps import ReferenceGraph

HOUSE = DATA / "photoreal-house"


@pytest.fixture(scope="module")
def store() -> ReferenceGraph:
    return learned(TOUR)


@pytest.fixture(scope="module")
def house() -> ReferenceGraph:
    return learned(HOUSE / "tour.mcap")


@pytest.mark.parametrize("name", [name for name in CASES if name not in AT_TWO_HERTZ])
def test_what_does_not_fit_is_said_in_one_line(name: str, store: ReferenceGraph, tmp_path: Path) -> None:
    (one,) = found(CASES[name], store, DRIVE, tmp_path)
    assert CASES[name].said in one.sentence


@needs_data
@pytest.mark.parametrize("name", AT_TWO_HERTZ)
def test_late_images_are_noticed_where_they_come_often(name: str, house: ReferenceGraph, tmp_path: Path) -> None:
    (one,) = found(CASES[name], house, HOUSE / "drive.mcap", tmp_path)
    assert CASES[name].said in one.sentence


def test_nothing_is_said_where_all_fits(store: ReferenceGraph, tmp_path: Path) -> None:
    assert found(Case(as_is, ""), store, DRIVE, tmp_path) == []
