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


def test_it_is_made_once_for_each_content_and_every_time_without_a_cache(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    assert [begun(cache), begun(cache), begun(cache, "b")] == [([97.0], True), ([97.0], False), ([98.0], True)]
    assert [begun(None), begun(None)] == [([97.0], True)] * 2


def test_where_chance_took_part_it_is_kept_for_its_seed(tmp_path: Path) -> None:
    cache = Cache(tmp_path)
    one, same, other = (begun(cache, seed=seed, noise=True) for seed in (1, 1, 2))
    assert [one[1], same[1], other[1]] == [True, False, True]
    assert one[0] == same[0] != other[0]


@pytest.mark.parametrize("content", [b"", b"faiss"])
def test_a_damaged_one_is_thrown_away_and_made_again(
    tmp_path: Path, content: bytes, capfd: pytest.CaptureFixture[str]
) -> None:
    cache = Cache(tmp_path)
    begun(cache)
    (file,) = tmp_path.glob("*.value")
    file.write_bytes(content)
    assert [begun(cache), begun(cache)] == [([97.0], True), ([97.0], False)]
    assert "made again" in capfd.readouterr().err
