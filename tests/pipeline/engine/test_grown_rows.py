"""What only grows is written once, and comes back as it was at each checkpoint."""

from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import Value
from omninav.pipeline.engine import checkpoint as checkpoints
from omninav.pipeline.engine.checkpoint import Checkpoint
from omninav.pipeline.engine.codec import BadEncoding, decode, encode, seal, unseal
from omninav.pipeline.engine.grown_rows import GrownRows


class Diary(Value):
    in_place = True
    grows = ("pages",)
    pages: np.ndarray
    title: str = ""


def pages(count: int) -> np.ndarray:
    return np.arange(3.0 * count).reshape(count, 3)


def save(place: Path, diary: Diary, rows: GrownRows) -> int:
    """Save a checkpoint; how many bytes the rows take then."""
    checkpoints.save(
        place / "checkpoint", Checkpoint("run", 1, channels={"diary.out@1<": [diary]}, held={"x": diary}), rows
    )
    return sum(file.stat().st_size for file in place.glob("*.rows"))


def loaded(place: Path, rows: GrownRows | None = None) -> Diary:
    found = checkpoints.load(place / "checkpoint", rows or GrownRows(place))
    assert found.held["x"] is found.channels["diary.out@1<"][0]
    return found.held["x"]


def test_only_new_rows_are_written_and_all_come_back(tmp_path: Path) -> None:
    diary, rows = Diary(pages(1000), "a"), GrownRows(tmp_path)
    first = save(tmp_path, diary, rows)
    diary.pages, diary.title = pages(1010), "b"
    assert save(tmp_path, diary, rows) - first < 1000
    assert (tmp_path / "checkpoint").stat().st_size < 2000
    again = GrownRows(tmp_path)
    diary = loaded(tmp_path, again)
    assert np.array_equal(diary.pages, pages(1010))
    assert diary.title == "b"
    size = save(tmp_path, diary, again)
    diary.pages = pages(1011)
    assert save(tmp_path, diary, again) - size < 200
    assert np.array_equal(loaded(tmp_path).pages, pages(1011))


def test_a_process_that_dies_after_its_rows_goes_on_from_the_checkpoint_before(tmp_path: Path) -> None:
    diary, rows = Diary(pages(10)), GrownRows(tmp_path)
    save(tmp_path, diary, rows)
    before = (tmp_path / "checkpoint").read_bytes()
    diary.pages = pages(15)
    save(tmp_path, diary, rows)
    save(tmp_path, Diary(-pages(40)), rows)  # another one in its place
    (tmp_path / "checkpoint").write_bytes(before)
    assert np.array_equal(loaded(tmp_path).pages, pages(10))


def test_another_value_in_its_place_is_written_whole_and_old_files_go(tmp_path: Path) -> None:
    rows = GrownRows(tmp_path)
    for number in range(5):
        save(tmp_path, Diary(pages(20) + number), rows)
        assert np.array_equal(loaded(tmp_path).pages, pages(20) + number)
    assert len(list(tmp_path.glob("*.rows"))) == 2


@pytest.mark.parametrize("damage", ["a bit", "cut"])
def test_damaged_rows_are_noticed(tmp_path: Path, damage: str) -> None:
    save(tmp_path, Diary(pages(100)), GrownRows(tmp_path))
    (file,) = tmp_path.glob("*.rows")
    content = bytearray(file.read_bytes())
    content[-1] ^= 1
    file.write_bytes(content if damage == "a bit" else content[:-1])
    with pytest.raises(BadEncoding, match=r"diary\.out\.pages\.1\.rows is (damaged|shorter)"):
        loaded(tmp_path)


@pytest.mark.parametrize("change", [{"name": "../out"}, {"sizes": {"title": 0}}, {"sizes": {"pages": None}}])
def test_a_checkpoint_that_names_other_files_or_fields_is_refused(tmp_path: Path, change: dict[str, object]) -> None:
    place = tmp_path / "run"
    save(place, Diary(pages(3)), GrownRows(place))
    content = decode(unseal((place / "checkpoint").read_bytes(), "checkpoint"))
    ((number, (name, where)),) = content["grown"].items()
    where |= {"sizes": change.get("sizes", where["sizes"])}
    content["grown"] = {number: (change.get("name", name), where)}
    (place / "checkpoint").write_bytes(seal(encode(content)))
    with pytest.raises(BadEncoding):
        loaded(place)
    assert [file.name for file in tmp_path.iterdir()] == ["run"]
