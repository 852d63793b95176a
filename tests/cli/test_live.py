"""`omninav live`: what it takes, and what it refuses in one line."""

import pytest
from conftest import TOUR

from omninav.pipeline.cli.commands import live
from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.problems import BadInput, ProblemsFound


@pytest.fixture
def typed(monkeypatch: pytest.MonkeyPatch) -> list[list[str]]:
    words: list[list[str]] = []
    monkeypatch.setattr(live, "run", lambda arguments, check: words.append(arguments))
    return words


def test_what_is_typed_takes_the_place_of_what_live_adds(typed: list[list[str]]):
    live.command(["variant=omniview_mcl"])
    live.command(["publish=amcl", "log=live"])
    live.command(["log=camera:0"])
    live.command(["log=camera:0", "publish=ros2"])
    assert typed == [
        ["source=live", "publish=ros2", "log=live", "variant=omniview_mcl"],
        ["source=live", "publish=amcl", "log=live"],
        ["source=live", "log=camera:0"],
        ["source=live", "log=camera:0", "publish=ros2"],
    ]


@pytest.mark.parametrize("variant", ["homing_field", "matched_pairs"])
def test_a_variant_that_is_no_robots_is_refused_by_name(variant: str):
    with composed([*live.SETTINGS, f"variant={variant}"]) as config:
        settings = complete(config)
    with pytest.raises(BadInput, match=f"variant={variant} does not run live .*; take another: omninav variants"):
        live.prepare_live(settings)


@pytest.mark.parametrize("publish", ["ros2", "amcl"])
@pytest.mark.parametrize(
    "words",
    ["omninav tour={}", "topological_localisation tour={}", "omniview_cml", "homing"],
    ids=lambda words: words[:9],
)
def test_a_variant_runs_live_without_what_it_is_measured_by(words: str, publish: str):
    typed = f"variant={words.format(TOUR)}".split()
    with composed(["source=live", "log=live", f"publish={publish}", "~evaluation", *typed]) as config:
        assert "publish" in live.prepare_live(complete(config)).graph.nodes


def test_a_wrong_setting_is_said_once_for_a_graph_and_those_of_its_maps():
    with composed(["variant=omniview_mcl", "watch=abc"]) as config:
        settings = complete(config)
    with pytest.raises(ProblemsFound) as found:
        live.prepare_live(settings)
    assert [problem.where for problem in found.value.problems] == ["nodes.watch.viewer"]
