"""Arrays in the front of an artifact file: read and checked where they are needed."""

import io
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt
import pytest
from conftest import RECORDINGS
from hypothesis import given
from hypothesis import strategies as st
from memory_peak import memory_peak
from small_run import reference_graph

from omninav.pipeline import BadInput, StoredRows, Value
from omninav.pipeline.engine import chunks
from omninav.pipeline.engine.artifact import check_artifact, read_artifact, read_header, write_artifact
from omninav.pipeline.engine.chunks import CHUNK, IN_MEMORY
from omninav.pipeline.graph.contents import Shape

ROWS = CHUNK // 8  # of 20 bytes: two and a half chunks


class Tall(Value):
    rows: Annotated[npt.NDArray[np.float32] | StoredRows[np.float32], Shape("N", 5)]
    numbers: Annotated[npt.NDArray[np.int64], Shape("N")]
    name: str = "tall"


@pytest.fixture(autouse=True)
def every_array_is_large(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(chunks, "IN_MEMORY", 0)


def numbered(count: int = ROWS) -> npt.NDArray[np.float32]:
    return np.arange(5 * count, dtype=np.float32).reshape(count, 5)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    write_artifact(tmp_path / "tall.omap", Tall(numbered(), np.arange(ROWS)), {"made": "by hand"})
    return tmp_path / "tall.omap"


def stored(file: Path) -> Any:
    found = read_artifact(file).rows  # type: ignore[attr-defined]
    assert isinstance(found, StoredRows)
    return found


def changed(file: Path, row: int) -> None:
    """Flip a bit of a row."""
    content = bytearray(file.read_bytes())
    at = content.index(numbered()[row].tobytes())
    content[at] ^= 1
    file.write_bytes(content)


INDICES = st.one_of(
    st.integers(-ROWS, ROWS - 1),
    st.slices(ROWS),
    st.lists(st.integers(-ROWS, ROWS - 1), max_size=9).map(lambda rows: np.array(rows, np.int64)),
    st.lists(st.integers(0, ROWS - 1), min_size=1, max_size=9).map(lambda rows: np.isin(np.arange(ROWS), rows)),
    st.tuples(st.integers(0, ROWS - 1), st.integers(0, 4)),
    st.just(Ellipsis),
    st.just(np.arange(12).reshape(3, 4)),
)


@given(st.data())
def test_rows_in_a_file_are_those_of_the_array(tmp_path_factory: pytest.TempPathFactory, data: st.DataObject) -> None:
    file = tmp_path_factory.getbasetemp() / "same.omap"
    if not file.exists():
        write_artifact(file, Tall(numbered(), np.arange(ROWS)))
    index = data.draw(INDICES)
    assert np.array_equal(stored(file)[index], numbered()[index])


def test_rows_say_what_they_are_and_are_an_array_where_all_is_asked_for(file: Path) -> None:
    rows = stored(file)
    assert (rows.shape, rows.dtype, len(rows), rows.nbytes) == ((ROWS, 5), np.float32, ROWS, 20 * ROWS)
    assert np.array_equal(np.asarray(rows), numbered())
    assert read_header(file)["facts"] == {"made": "by hand"}
    with pytest.raises(IndexError, match=f"no row {ROWS}"):
        rows[[0, ROWS]]
    with pytest.raises(IndexError, match="a mask of the shape"):
        rows[np.ones(3, bool)]


def test_a_damaged_chunk_is_named_when_it_is_read_and_the_others_are_used(file: Path) -> None:
    changed(file, ROWS - 1)
    rows = stored(file)
    assert np.array_equal(rows[:1000], numbered()[:1000])
    with pytest.raises(BadInput, match=r"tall\.omap: chunk \d of the array 'rows' \(from byte \d+\) is damaged"):
        rows[[3, ROWS - 1]]
    with pytest.raises(BadInput, match="is damaged"):
        check_artifact(file)


def test_numbers_that_are_not_finite_are_refused_when_they_are_read(tmp_path: Path) -> None:
    rows = numbered()
    rows[-1, 2] = np.nan
    write_artifact(tmp_path / "nan.omap", Tall(rows, np.arange(ROWS)))
    assert stored(tmp_path / "nan.omap")[0, 1] == 1.0
    with pytest.raises(BadInput, match=r"nan\.omap: rows \d+ to \d+ of the array 'rows' hold numbers that are not"):
        check_artifact(tmp_path / "nan.omap")


@pytest.mark.parametrize(("in_memory", "check"), [(0, check_artifact), (IN_MEMORY, read_artifact)])
def test_any_damaged_byte_of_a_file_is_found_and_any_cut(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, in_memory: int, check: Callable[[Path], object]
) -> None:
    monkeypatch.setattr(chunks, "IN_MEMORY", in_memory)
    file = tmp_path / "small.omap"
    write_artifact(file, Tall(numbered(7), np.arange(7)))
    good = file.read_bytes()
    for at in range(0, len(good), 7):
        file.write_bytes(good[:at] + bytes([good[at] ^ 1 << at % 8]) + good[at + 1 :])
        with pytest.raises(BadInput, match=r"small\.omap: "):
            check(file)
    for length in range(0, len(good), 97):
        file.write_bytes(good[:length])
        with pytest.raises(BadInput, match=r"small\.omap: "):
            read_artifact(file)


def test_rows_are_written_again_without_reading_them_into_memory(file: Path, tmp_path: Path) -> None:
    write_artifact(tmp_path / "large.omap", Tall(numbered(1 << 20), np.arange(1 << 20)))  # 21 MB
    large = read_artifact(tmp_path / "large.omap")
    assert memory_peak(write_artifact, tmp_path / "again.omap", large) < 4e6
    assert (tmp_path / "again.omap").read_bytes() == (tmp_path / "large.omap").read_bytes()
    assert isinstance(large, Tall)
    assert np.array_equal(large.rows[:], numbered(1 << 20))


def test_a_file_that_is_cut_off_while_it_is_used_is_named(file: Path) -> None:
    rows = stored(file)
    assert rows[0, 1] == 1.0
    with file.open("r+b") as opened:
        opened.truncate(100)
    with pytest.raises(BadInput, match=r"tall\.omap: cut off while it was read"):
        rows[0]
    with pytest.raises(BadInput, match=r"tall\.omap: chunk \d of the array 'rows' .* is damaged"):
        rows[-1]


def test_the_head_of_an_array_states_as_many_bytes_as_there_are() -> None:
    many, short = "an array of nothing has 16777217 rows", "not as long as it states"
    right: list[Any] = [((3, 2), 48, None), ((0, 2), 0, None), ((1 << 24, 0), 0, None)]
    for shape, more, said in (*right, ((1 + (1 << 24), 0), 0, many), ((3, 2), 49, short), ((-3, -2), 48, short)):
        head = io.BytesIO()
        np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": shape})
        length = head.tell() + more
        head.seek(0)
        with nullcontext() if said is None else pytest.raises(chunks.Unfit, match=said):
            assert chunks.parse_npy_head(head, length) == (shape, np.float64)


def test_numpy_opens_a_file_and_its_arrays_lie_where_they_can_be_mapped(file: Path) -> None:
    with np.load(file, allow_pickle=False) as archive:
        assert np.array_equal(archive["rows"], numbered())
    assert file.read_bytes().index(numbered().tobytes()) % 64 == 0


def test_a_map_of_the_format_before_is_read() -> None:
    known = reference_graph(6)
    file = RECORDINGS / "references_format_1.omap"
    old = read_artifact(file)
    assert read_header(file)["format"] == 1
    for name in ("poses", "features", "edges"):
        assert np.array_equal(getattr(old, name), getattr(known, name))
