"""A map that stays in its file gives what one in memory gives, byte for byte."""

from pathlib import Path

import pytest
from conftest import DRIVE

from omninav.pipeline.cli.main import main
from omninav.pipeline.engine import chunks
from omninav.pipeline.graph.stored_rows import FileRows


@pytest.mark.parametrize("words", [(), ("sensor=expected_observation",)])
def test_a_drive_is_localised_the_same_in_a_map_that_stays_in_its_file(
    demo: Path, shared_cache: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...]
) -> None:
    read: list[int] = []
    gathered = FileRows._gathered

    def counted(self: FileRows, rows: chunks.Ints) -> object:
        read.append(len(rows))
        return gathered(self, rows)

    monkeypatch.setattr(FileRows, "_gathered", counted)
    monkeypatch.chdir(tmp_path)
    settings = (f"map={demo / 'map.omap'}", f"log={DRIVE}", "nodes.source.stop=8", "plots=none", "cache=null", *words)
    for limit, folder in ((chunks.IN_MEMORY, "memory"), (0, "file")):
        monkeypatch.setattr(chunks, "IN_MEMORY", limit)
        assert main([*settings, f"hydra.run.dir={folder}"]) == 0
        assert bool(read) == (folder == "file")
    for name in ("trajectory.tum", "metrics.json", "map.omap"):
        assert (tmp_path / "file" / name).read_bytes() == (tmp_path / "memory" / name).read_bytes()
