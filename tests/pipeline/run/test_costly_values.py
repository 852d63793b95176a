"""What takes long to make before the loop is made once, found by content, and made again where it was damaged."""

from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from omninav.pipeline import Context, Outputs, Stage, Value
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.graph.builder import build
from omninav.pipeline.run.costly_values import costly_values
from toys import Ledger


class Table(Value):
    costly: ClassVar[bool] = True
    rows: np.ndarray


class MakeTable(Stage):
    """A table of a ledger, with noise where it is wanted."""

    noise: bool = False

    class Out(Outputs):
        table: Table

    def step(self, ctx: Context, ledger: Ledger) -> Out:
        ctx.fact("made", True)
        rows = np.array(ledger.entries)
        return self.Out(table=Table(rows + ctx.rng.random(len(rows)) if self.noise else rows))


def begun(cache: Cache | None, content: str = "a", seed: int = 0, noise: bool = False) -> tuple[np.ndarray, bool]:
    """The table, and whether it had to be made."""
    nodes = {"table": {"_target_": f"{__name__}.MakeTable", "noise": noise}}
    graph = build({"nodes": nodes, "wires": {"table": {"ledger": "artifacts.ledger"}}}, {"ledger": Ledger})
    engine = Engine(graph, {"ledger": Ledger([float(ord(content))])}, EngineOptions(seed))
    with costly_values(engine, cache, {"ledger": content}, seed):
        engine.begin()
    assert engine.calls["table"].ctx.facts == {"made": True}
    return engine.values["table.table"].rows, bool(len(engine.calls["table"].times))


def test_it_is_made_once_for_each_content(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    first, again, other = begun(cache), begun(cache), begun(cache, "b")
    assert [first[1], again[1], other[1]] == [True, False, True]
    assert first[0] == again[0] == [97.0]
    assert other[0] == [98.0]


def test_without_a_cache_it_is_made_every_time() -> None:
    assert begun(None)[1]
    assert begun(None)[1]


def test_where_chance_took_part_it_is_kept_for_its_seed(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    one, same, other = (begun(cache, seed=seed, noise=True) for seed in (1, 1, 2))
    assert [one[1], same[1], other[1]] == [True, False, True]
    assert one[0] == same[0] != other[0]


@pytest.mark.parametrize("damage", ["cut", "flipped", "other file"])
def test_a_damaged_one_is_thrown_away_and_made_again(
    tmp_path: Path, damage: str, capsys: pytest.CaptureFixture[str], caplog: pytest.LogCaptureFixture
) -> None:
    cache = Cache(tmp_path)
    expected, _ = begun(cache)
    (file,) = tmp_path.glob("*.value")
    content = file.read_bytes()
    flipped = content[:-5] + bytes([content[-5] ^ 1]) + content[-4:]
    file.write_bytes({"cut": content[:100], "flipped": flipped, "other file": b"faiss"}[damage])
    healed, made = begun(cache)
    assert made
    assert healed == expected
    assert "made again" in capsys.readouterr().err + caplog.text
    assert not begun(cache)[1]
