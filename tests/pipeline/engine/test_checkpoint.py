"""A checkpoint is saved whole and loaded bit for bit."""

from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline.engine import checkpoint as checkpoints
from omninav.pipeline.engine.checkpoint import Checkpoint
from omninav.pipeline.engine.codec import BadEncoding, encode, seal
from omninav.pipeline.engine.grown_rows import GrownRows
from toys import Big, Ledger, Number


def saved_and_loaded(checkpoint: Checkpoint, place: Path) -> Checkpoint:
    checkpoints.save(place / "checkpoint", checkpoint, GrownRows(place))
    return checkpoints.load(place / "checkpoint", GrownRows(place))


def test_it_comes_back_as_it_was_saved(tmp_path: Path):
    given = Checkpoint(
        identity="this run",
        ticks=7,
        ended=True,
        replayed=True,
        channels={"a.number@2<": [None, Number(2.5)]},
        held={"b.big": Big(np.arange(3.0))},
        states={"seen": {"values": (1.0, 2.0)}},
        generators={"noise": dict(np.random.default_rng(3).bit_generator.state)},
        notes={"noise": {"counts": {"odd": 2}, "details": {}, "facts": {}, "drew": True}},
        sequences={"a.number": 120},
    )
    found = saved_and_loaded(given, tmp_path)
    for name in ("identity", "ticks", "ended", "replayed", "states", "generators", "notes", "sequences"):
        assert getattr(found, name) == getattr(given, name), name
    first, second = found.channels["a.number@2<"]
    assert (first, second.value) == (None, 2.5)
    assert found.held["b.big"].array.tolist() == [0.0, 1.0, 2.0]


def test_a_value_that_stands_in_two_places_is_one_object_again(tmp_path: Path):
    ledger = Ledger([1.0])
    found = saved_and_loaded(Checkpoint("run", 1, channels={"delayed": [ledger]}, held={"kept": ledger}), tmp_path)
    assert found.held["kept"] is found.channels["delayed"][0]
    assert found.held["kept"].entries == [1.0]


def test_damage_and_another_version_are_refused_by_name(tmp_path: Path):
    path = tmp_path / "checkpoint"
    checkpoints.save(path, Checkpoint("run", 1), GrownRows(tmp_path))
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    with pytest.raises(BadEncoding, match=r"checkpoint is damaged: its sha256 does not fit"):
        checkpoints.load(path, GrownRows(tmp_path))
    path.write_bytes(seal(encode({"format": 0})))
    with pytest.raises(BadEncoding, match=r"was written by another version of omninav; start the run again"):
        checkpoints.load(path, GrownRows(tmp_path))
