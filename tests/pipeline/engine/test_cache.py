"""A cache heals: what is damaged or of another key is thrown away, made again, and said once."""

import os
from pathlib import Path

import pytest

from omninav.pipeline.engine import damage
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.codec import encode, seal
from omninav.pipeline.files import digest_text, write_whole

ONE, OTHER = digest_text("one"), digest_text("other")


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cache:
    monkeypatch.setattr(damage, "_shown", set())
    return Cache(tmp_path / "cache")


def kept(cache: Cache, key: str, content: bytes) -> Path:
    with cache.keep(key, ".result", {"made": "by hand"}) as part:
        part.write_bytes(content)
    return cache.path(key, ".result")


def test_a_result_is_found_with_its_notes_under_its_key_only(cache: Cache):
    path = kept(cache, ONE, b"result")
    assert cache.find(ONE, ".result") == (path, {"made": "by hand"})
    assert cache.find(OTHER, ".result") is None


@pytest.mark.parametrize("suffix", ["", ".entry"])
@pytest.mark.parametrize("bit", [0, 7, 23, 47])
def test_a_flipped_bit_is_found_thrown_away_and_said_once(
    cache: Cache, suffix: str, bit: int, capfd: pytest.CaptureFixture[str]
):
    file = kept(cache, ONE, b"result").with_suffix(f".result{suffix}")
    content = bytearray(file.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)
    assert cache.find(ONE, ".result") is None
    assert cache.find(ONE, ".result") is None
    assert capfd.readouterr().err.count("thrown away and made again") == 1
    assert not any(cache.folder.iterdir())
    kept(cache, ONE, b"result")
    assert cache.find(ONE, ".result") is not None


def test_half_a_result_or_that_of_another_key_under_this_name_is_none(cache: Cache):
    one, other = kept(cache, ONE, b"one"), cache.path(OTHER, ".result")
    for suffix in (".result", ".result.entry"):
        one.with_suffix(suffix).rename(other.with_suffix(suffix))
    assert cache.find(OTHER, ".result") is None
    kept(cache, ONE, b"one").with_suffix(".result.entry").unlink()
    assert cache.find(ONE, ".result") is None


@pytest.mark.parametrize("content", [b"", seal(b""), seal(encode([])), seal(encode({"key": ONE}))])
def test_an_entry_that_states_nothing_is_no_entry(cache: Cache, content: bytes):
    write_whole(kept(cache, ONE, b"one").with_suffix(".result.entry"), content)
    assert cache.find(ONE, ".result") is None


@pytest.mark.parametrize("link", [os.symlink, os.link])
def test_a_lock_follows_no_link(cache: Cache, tmp_path: Path, link: object):
    write_whole(tmp_path / "mine", "mine")
    cache.folder.mkdir()
    link(tmp_path / "mine", cache.path(ONE, ".lock"))  # type: ignore[operator]
    with pytest.raises(OSError, match="delete it"), cache.lock(ONE):
        pass
    assert (tmp_path / "mine").read_text() == "mine"
