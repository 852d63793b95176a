"""Values as bytes and back, and files that notice damage."""

import json
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import toys
from omninav.pipeline.engine.codec import BadEncoding, decode, decode_all, encode, encode_all, seal, unseal
from omninav.pipeline.engine.disk_sequence import DiskSequence, Present
from omninav.pipeline.graph.value import VALUE_TYPES, Value, value_name

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats(allow_nan=False) | st.text() | st.binary(),
    lambda inner: (
        st.lists(inner) | st.lists(inner).map(tuple) | st.dictionaries(st.text() | st.integers(), inner, max_size=4)
    ),
    max_leaves=12,
)


@given(plain)
def test_plain_data_comes_back_as_it_was(thing: object):
    assert decode(encode(thing)) == thing


@given(
    arrays.arrays(
        dtype=st.sampled_from(["f8", "f4", "u1", "i8", "?", "c16"]), shape=arrays.array_shapes(min_dims=0, min_side=0)
    )
)
def test_arrays_come_back_bit_for_bit(array: np.ndarray):
    back = decode(encode({"a": array, "b": [array]}))
    for one in (back["a"], back["b"][0]):
        assert (one.dtype, one.shape, one.tobytes()) == (array.dtype, array.shape, array.tobytes())


@given(
    st.lists(
        plain
        | st.floats(allow_nan=False).map(toys.Number)
        | st.integers(1, 3).map(lambda rows: toys.Big(np.arange(2.0 * rows).reshape(rows, 2)))
        | st.dictionaries(st.sampled_from("ab"), plain, max_size=2)
    )
)
def test_things_that_are_written_together_come_back_each(things: list[object]):
    back = decode_all(encode_all(things), len(things))
    assert [encode(thing) for thing in back] == [encode(thing) for thing in things]
    assert list(map(type, back)) == list(map(type, things))


def test_arrays_of_one_form_are_written_together_and_come_back_apart():
    for array in (np.full((2, 3), 1.5, np.float32), np.array(2.0), np.zeros((0, 3)), np.asfortranarray(np.eye(3))):
        first, second = decode_all(encode_all([array, array + 1]), 2)
        np.testing.assert_array_equal(second, array + 1)
        assert (first.dtype, first.shape, type(first)) == (array.dtype, array.shape, np.ndarray)
        first[...] = 7.0
        np.testing.assert_array_equal(second, array + 1)
    content = encode_all([toys.Number(1.0)] * 50)
    assert content.count(b"toys.Number") == 1
    with pytest.raises(BadEncoding):
        decode_all(content, 49)


class Marked(Value):
    name: str
    number: int = 7


def test_a_value_of_an_older_file_takes_the_defaults_of_fields_that_are_new():
    def of_fields(*fields):
        header = json.dumps(["value", value_name(Marked), *fields]).encode()
        return len(header).to_bytes(8, "little") + header

    for fields, number in ((["a", 3], 3), (["a"], 7)):
        found = decode(of_fields(*fields))
        assert (found.name, found.number) == ("a", number)
    for wrong in ([], ["a", 3, 4]):
        with pytest.raises(BadEncoding, match=f"has 2 fields now, {len(wrong)} in the file"):
            decode(of_fields(*wrong))


def test_values_counters_paths_and_scalars_come_back():
    big = decode(encode((toys.Number(1.5), toys.Big(np.arange(3)), Counter("aab"), Path("x/y"), np.float32(0.1))))
    assert isinstance(big[0], toys.Number)
    assert big[0].value == 1.5
    assert list(big[1].array) == [0, 1, 2]
    assert big[2:] == (Counter("aab"), Path("x/y"), np.float32(0.1))


def test_what_is_no_value_cannot_be_written_or_named():
    with pytest.raises(BadEncoding, match="make it a Value"):
        encode(object())
    with pytest.raises(BadEncoding, match="array of object"):
        encode(np.array([object()]))
    for array in (np.zeros(2, [("a", float)]), np.ma.masked_less(np.arange(3.0), 1)):
        for write in (encode, lambda array: encode_all([array, array])):
            with pytest.raises(BadEncoding, match="use a plain array of numbers"):
                write(array)
    forged = encode(toys.Number(1.0)).replace(b"toys.Number", b"os.PathLike")
    with pytest.raises(BadEncoding, match=r"unknown value type 'os\.PathLike'"):
        decode(forged)


def test_fields_of_others_values_are_known_by_their_names(monkeypatch: pytest.MonkeyPatch):
    class Pair(Value):
        x: float
        y: float

    one, several = encode(Pair(1.0, 2.0)), encode_all([Pair(1.0, 2.0)] * 2)
    name = value_name(Pair)

    class Turned(Value):
        y: float
        x: float
        z: float = 0.0

    monkeypatch.setitem(VALUE_TYPES, name, Turned)
    for back in (decode(one), *decode_all(several, 2)):
        assert (back.x, back.y, back.z) == (1.0, 2.0, 0.0)

    class Renamed(Value):
        x: float
        width: float

    monkeypatch.setitem(VALUE_TYPES, name, Renamed)
    with pytest.raises(BadEncoding, match="has the fields x, width now, x, y in the file"):
        decode(one)


def test_a_value_of_a_file_is_read_where_the_file_lies_elsewhere_now(monkeypatch: pytest.MonkeyPatch):
    class Level(Value):
        height: float

    monkeypatch.setattr(Level, "__module__", "omninav_plugin_levels_0123abcd")
    written = encode(Level(1.5)).replace(b"0123abcd", b"89efcdab")
    with pytest.raises(BadEncoding, match="unknown value type"):
        decode(written)
    monkeypatch.setitem(VALUE_TYPES, value_name(Level), Level)
    assert decode(written).height == 1.5


@given(st.data())
def test_a_flipped_or_cut_seal_is_noticed(data: st.DataObject):
    sealed = bytearray(seal(encode({"a": np.arange(20)})))
    if data.draw(st.booleans()):
        sealed[data.draw(st.integers(0, len(sealed) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    else:
        sealed = sealed[: data.draw(st.integers(0, len(sealed) - 1))]
    with pytest.raises(BadEncoding, match="the thing is damaged"):
        unseal(bytes(sealed), "the thing")


def test_a_spool_is_read_lazily_and_cut_back_to_a_length(tmp_path: Path):
    spool = DiskSequence(tmp_path / "numbers.spool")
    for number in range(5):
        spool.append(toys.Number(float(number)) if number != 2 else None)
    size = spool.size
    spool.append(toys.Number(9.0))
    assert len(spool) == 6
    spool.cut(size)
    assert [n.value if n else None for n in spool] == [0, 1, None, 3, 4]
    assert spool[-1].value == 4
    assert [n.value for n in spool[3:]] == [3, 4]
    spool.close()
    again = DiskSequence(tmp_path / "numbers.spool")
    assert len(again) == 5
    with pytest.raises(BadEncoding, match="shorter than its checkpoint"):
        again.cut(size + 1)


def test_a_spool_that_was_read_is_cut_and_goes_on(tmp_path: Path):
    spool = DiskSequence(tmp_path / "arrays.spool")
    sizes = []
    for number in range(6):  # each longer than a block
        sizes.append(spool.size)
        spool.append(toys.Big(np.full((1, 100_000), number)) if number % 2 else None)
    assert list(spool.present()) == [1, 3, 5]
    assert [int(big.array[0, -1]) for big in Present(spool)] == [1, 3, 5]
    spool.cut(sizes[5])
    spool.append(toys.Big(np.full((1, 100_000), 7)))
    spool.append(None)
    assert [int(big.array[0, 0]) for big in Present(spool)] == [1, 3, 7]
    spool.verify(7)


def test_a_spool_writes_small_values_together_and_large_ones_at_once(tmp_path: Path):
    spool = DiskSequence(tmp_path / "mixed.spool")
    values = [toys.Number(float(n)) if n % 3 else None for n in range(200)]
    written = []
    for value in values:
        spool.append(value)
        written.append(spool.path.stat().st_size)
    assert len(set(written)) <= 2  # the operating system has the first record at most
    assert len(spool) == 200
    assert spool.path.read_bytes().count(b"toys.Number") == 5  # 1, three times 64, and the rest; 0 is absent
    assert [None if n is None else n.value for n in spool] == [None if n is None else n.value for n in values]
    assert [spool[n].value for n in (1, 64, 65, 128, -1)] == [1, 64, 65, 128, 199]
    assert [n.value for n in Present(spool)[40:42]] == [61, 62]
    spool.append(toys.Big(np.zeros((1, 1 << 20))))
    spool.flush()
    before = spool.path.stat().st_size
    spool.append(toys.Big(np.ones((1, 1 << 20))))
    assert spool.path.stat().st_size > before
    assert spool[201].array[0, 0] == 1
    spool.verify(202)
