"""A drive through the built-in world stands in where no log is named."""

import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.problems import ProblemsFound
from omninav.stages.source.log import LogSource
from omninav.stages.source.simulated import SimulatedSource

DATA = Path(__file__).parents[1] / "data"
LOGS = f"log={DATA / 'drive.mcap'}", f"tour={DATA / 'tour.mcap'}"


def completed(*words: str) -> dict[str, Any]:
    with composed(words) as config:
        return complete(config)


def sources(config: dict[str, Any]) -> list[dict[str, Any]]:
    """The source of a run, and the one that its map is learned from."""
    return [config["nodes"]["source"], config["artifacts"]["map"]["graph"]["nodes"]["source"]]


def name_of(stage: type) -> str:
    return f"{stage.__module__}.{stage.__qualname__}"


def test_the_world_is_driven_through_where_no_log_is_named_and_parameters_that_are_set_stay():
    drive, tour = sources(completed("nodes.source.stop=5", "nodes.source.kidnappings=[{at: 3.0, turn: 1.5}]", "day=2"))
    assert drive["_target_"] == tour["_target_"] == name_of(SimulatedSource)
    assert (drive["route"], drive["day"], tour["route"], tour["day"]) == ("drive", 2, "tour", 0)
    assert drive["world"] == tour["world"]
    assert drive["stop"] == tour["stop"] == 5
    assert drive["kidnappings"] == [{"at": 3.0, "turn": 1.5}]


def test_a_recorded_log_is_read_and_its_configuration_says_nothing_of_worlds():
    config = completed(*LOGS, "nodes.source.stop=5", "nodes.source.layout_folders=[here]")
    assert [source["_target_"] for source in sources(config)] == [name_of(LogSource)] * 2
    assert [source["stop"] for source in sources(config)] == [5, 5]
    config.pop("inputs")  # sentences on what may be given
    said = re.findall(r"\b(?:world|route|day|kidnappings):", yaml.safe_dump(config))
    assert said == []


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*LOGS, "source=simulated"), "log: source=simulated does not read it"),
        ((*LOGS, "kidnappings=[{at: 30.0, turn: 1.5}]"), "a robot is lifted in the built-in world alone; cuts="),
        ((*LOGS, "route=kitchen"), "route: nothing in this run reads it"),
        ((*LOGS, "world=office"), "world: nothing in this run reads it"),
        (("source=live", "publish=ros2", "log=live", "world=office"), "world: nothing in this run reads it"),
        (("camera=camera.yaml",), "that of the simulated world is world_camera=… (or world.camera)"),
        (("speed=0.4", "rate=2"), "speed: without log=… nothing reads it"),
        (("variant=retrieval_mcl", "forgetting=none"), "forgetting: nothing in this run reads it"),
        (("nodes.source.layout_folders=[here]",), "SimulatedSource has no parameter 'layout_folders'"),
        ((*LOGS, "nodes.source.route=tour"), "LogSource has no parameter 'route'"),
    ],
)
def test_a_parameter_of_the_other_one_is_refused(words: tuple[str, ...], said: str):
    with pytest.raises(ProblemsFound, match=re.escape(said)):
        completed(*words)
