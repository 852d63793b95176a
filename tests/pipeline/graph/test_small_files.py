"""Small YAML files: plain data, or one line that names file and place."""

import os
import time
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.small_files import parse_yaml, read_small, read_yaml

BOMB = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
    f"{name}: &{name} [{', '.join([f'*{before}'] * 9)}]\n" for before, name in zip("abcdefgh", "bcdefghi", strict=True)
)
PLAIN = st.recursive(
    st.none()
    | st.booleans()
    | st.integers(-(2**63) + 1, 2**63 - 1)
    | st.floats(allow_nan=False, allow_infinity=False)
    | st.text(st.characters(exclude_categories=["C"]), max_size=40),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text("abc ", max_size=3), inner, max_size=4),
    max_leaves=20,
)


@given(PLAIN)
def test_what_is_written_is_read_back(value: object) -> None:
    assert parse_yaml(yaml.safe_dump(value), "written.yaml") == value


def test_aliases_and_merges_are_followed_and_dates_stay_texts() -> None:
    text = "a: &a {x: 1, y: 2}\nb: {<<: *a, y: 3}\nc: [*a, 2001-99-99]\nd: 0x1F\ne: 9223372036854775807"
    expected = {"a": {"x": 1, "y": 2}, "b": {"x": 1, "y": 3}, "c": [{"x": 1, "y": 2}, "2001-99-99"], "d": 31}
    expected["e"] = 2**63 - 1
    assert parse_yaml(text, "file") == expected
    assert parse_yaml("", "file") is None


def test_values_that_an_alias_repeats_count_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("omninav.pipeline.graph.small_files.MAX_VALUES", 7)
    assert parse_yaml("[&a [1], &b [2], *b]", "file") == [[1], [2], [2]]
    with pytest.raises(BadInput, match="more than 7 values"):
        parse_yaml("[&a [1], &b [2], *b, 3]", "file")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: " + "9" * 5000, "file, line 2: a number of 5000 characters, expected at most 100"),
        ("a: 99999999999999999999", "file, line 1: the whole number '99999999999999999999' is too large"),
        ("a: 9223372036854775808", "file, line 1: the whole number '9223372036854775808' is too large"),
        ("a: !!timestamp x", "file, line 1: the tag 'tag:yaml.org,2002:timestamp'; write the value without a tag"),
        ("a: !!python/object/apply:os.system [x]", "file, line 1: the tag 'tag:yaml.org,2002:python/object/apply:os"),
        ("a: !!pairs [a: 1]", "file, line 1: the tag"),
        (BOMB, "more than 50,000 values"),
        ("[" * 60, "more than 40 levels"),
        ("a:\n  b: .nan", "file, line 2: '.nan' is not finite, expected a number"),
        ("- -.inf", "file, line 1: '-.inf' is not finite"),
        ("a: 1.0e+999", "file, line 1: '1.0e+999' is not finite"),
        ("a: 1\n\na: 2", "file, line 3: the key 'a' occurs twice"),
        ("[1, 2]: 3", "file, line 1: a list or mapping as a key, expected a name"),
        ("a: *b", "file, line 1: *'b' refers to an anchor that is not defined yet"),
        ("a: &b [*b]", "file, line 1: *'b' refers to an anchor that is not defined yet"),
        ("a: 1\n---\nb: 2", "file, line 2: a second document begins"),
        ("a: [1, 2", "not valid YAML"),
        ("a: \0", "not valid YAML"),
        ("a: \x1b[31m", "not valid YAML"),
        (b"a: \xff", "file: byte 3 is not UTF-8"),
        (b"x" * 2_000_000, "file: more than 1,000,000 "),
    ],
)
def test_what_breaks_a_limit_is_one_short_line_with_its_place(text: str | bytes, said: str) -> None:
    began = time.process_time()
    with pytest.raises(BadInput) as caught:
        parse_yaml(text, "file")
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300
    assert time.process_time() - began < 1


def test_what_is_no_file_is_named_without_waiting_for_it(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "loop").symlink_to("loop")
    for path, said in (
        (tmp_path / "pipe", "this is a pipe, expected a file"),
        (tmp_path, "this is a folder, expected a file"),
        (Path("/dev/zero"), "this is a device, expected a file"),
        (tmp_path / "loop", "Too many levels of symbolic links"),
        (tmp_path / "none", "No such file or directory"),
        (tmp_path / ("x" * 300), "File name too long"),
        (Path("a\0b"), "null byte"),
    ):
        with pytest.raises(BadInput, match=said) as caught:
            read_yaml(path)
        assert "\0" not in str(caught.value)
    (tmp_path / "long").write_bytes(b"x" * 11)
    with pytest.raises(BadInput, match="more than 10 bytes"):
        read_small(tmp_path / "long", 10)
