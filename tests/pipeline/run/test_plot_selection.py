"""Which plots a run draws, and how those that it did not draw are drawn later."""

from pathlib import Path
from typing import Any

import pytest
from toy_runs import begun, ended

from omninav.pipeline.files import digest_file, read_json
from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.pipeline.run.redraw import redraw
from omninav.pipeline.run.resume import resume
from toys import graph_of_toys

COUNTED = {"number": "source.number"}
ADDED = {"numbers": {"from": "add.number", "collect": True}}
SCALED = {"numbers": {"from": "scaled.number", "collect": True}}
CONFIG = graph_of_toys(
    {"source": "Count", "add": "Add", "scaled": "Scale", "total": "Total", "quick": "Draw", "slow": "DrawSlowly"},
    {"add": COUNTED, "scaled": COUNTED, "total": ADDED, "quick": ADDED, "slow": SCALED},
    variant="toy",
)


def nodes(**settings: Any) -> set[str]:
    return set(prepare_run(CONFIG | settings).graph.nodes)


def test_slow_plots_and_what_only_they_read_are_left_out_unless_all_are_asked_for() -> None:
    assert set(CONFIG["nodes"]) - nodes() == {"slow", "scaled"}
    assert nodes(plots="few") == nodes()
    assert nodes(plots="all") == set(CONFIG["nodes"])
    assert nodes(plots="none") == {"source", "add", "total"}
    assert "scaled" in nodes(saves={"last": "scaled.number"})
    with pytest.raises(ProblemsFound, match="'some', expected auto, few, all, none"):
        prepare_run(CONFIG | {"plots": "some"})


def test_a_run_that_ended_is_drawn_with_all_plots_and_stays_whole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = ended(CONFIG | {"runs": str(tmp_path)})
    monkeypatch.chdir(tmp_path)  # it was started elsewhere
    before = {file.name: digest_file(file) for file in run.folder.iterdir() if file.is_file()}
    assert (run.folder / "report.html").read_text().count("<figure id=") == 1
    redraw(run.folder, "all")
    assert Path.cwd() == tmp_path
    page = (run.folder / "report.html").read_text()
    assert page.count("<figure id=") == 2
    assert f"{run.folder.name}</pre>" in page  # and not the folder in which it was drawn
    after = {file.name: digest_file(file) for file in run.folder.iterdir() if file.is_file()}
    assert {name for name in before if before[name] != after.get(name)} == {"report.html", "manifest.json"}
    assert before.keys() == after.keys()
    assert resume(run.folder)[0].complete  # nothing seems damaged


def test_a_run_that_gives_other_figures_now_is_not_drawn(tmp_path: Path) -> None:
    run = ended(CONFIG | {"runs": str(tmp_path)})
    (run.folder / "metrics.json").write_text('{"other": 1}')
    page = (run.folder / "report.html").read_bytes()
    with pytest.raises(BadInput, match="it gives other metrics now"):
        redraw(run.folder, "all")
    assert (run.folder / "report.html").read_bytes() == page
    assert read_json(run.folder / "manifest.json")["status"] == "complete"
    assert not list(run.folder.glob(".report.*"))


def test_a_run_that_has_not_ended_is_not_drawn(tmp_path: Path) -> None:
    run = begun(CONFIG | {"runs": str(tmp_path)})
    with pytest.raises(BadInput, match=r"omninav resume .* continues it"):
        redraw(run.folder, "all")
