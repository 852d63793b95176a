"""`result.mcap`, its layout and the server, as Foxglove's own JavaScript packages see them."""

import json
import shutil
import socket
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from made_places import made_map
from result_of import shown_of, write_result
from small_run import mixture_run, small_run

from omninav.pipeline import BadInput, Context
from omninav.stages.plots.small_panorama import SmallPanorama
from omninav.stages.plots.tick_messages import PathSoFar
from omninav.stages.plots.watch_run import WatchRun
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.image import Panorama
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.visual_distance import VisualDistances

HERE = Path(__file__).parent
PLAN = FloorPlan(np.array([[[2.0, 2.0], [4.0, 2.0], [4.0, 3.0], [2.0, 3.0]]]), 6.0, 4.0)
PANORAMA = SmallPanorama().step(Context("small"), Panorama(np.full((90, 720, 3), 90, np.uint8))).panorama
VECTOR = HomingVector(0, 0.5, 0.1, 1.0, 1.0, 1.0, 1.5, 30, "tracking")
needs_node = pytest.mark.skipif(
    shutil.which("node") is None or not (HERE / "node_modules").is_dir(),
    reason="Foxglove's readers are not installed: cd tests/foxglove && npm install",
)


def node(script: str, *arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(["node", str(HERE / script), *arguments], stdout=subprocess.PIPE, text=True)


def read(log: Path) -> dict[str, dict]:
    return json.loads(node("read_log.js", str(log)).communicate(timeout=60)[0])


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture(scope="module")
def logs(tmp_path_factory) -> dict[str, Path]:
    """Results with every topic there is: of references, of mixtures, of places."""
    run, folders = (
        small_run(frames=21),
        {name: tmp_path_factory.mktemp(name) for name in ("graph", "mixtures", "places")},
    )
    similarities = Similarities(np.linspace(0, 1, 40 * 3, dtype=np.float32).reshape(40, 3))
    learned, gaussians, *_ = mixture_run(run)
    places = made_map([(0, 0), (2, 0), (4, 0), (4, 2), (4, 4)], {(n, n + 1): 2 for n in range(4)}, names=["hall"] * 5)
    believed = PlaceBelief(np.full(5, 0.2), places.poses[places.places])
    seen = VisualDistances(np.arange(5.0), np.zeros(5), np.arange(5))
    route = PlannedRoute(np.arange(3), "under way", 0)
    driving = {"command": Command(0.2, 0.1), "vector": VECTOR, "route": route, "similarities": seen}
    write_result(
        folders["graph"], run, plan=PLAN, panorama=PANORAMA, similarities=similarities, confidence=PoseConfidence(0.8)
    )
    write_result(folders["mixtures"], run, gaussians, learned)
    write_result(folders["places"], run, [believed] * 21, places, **driving)
    return folders


@needs_node
@pytest.mark.parametrize("name", ["graph", "mixtures", "places"])
def test_foxglove_reads_every_message_and_knows_its_definition(logs, name):
    found = read(logs[name] / "result.mcap")
    assert {topic: entry["differences"] for topic, entry in found.items() if entry["differences"]} == {}
    frames = [(t["header"]["frame_id"], t["child_frame_id"]) for t in found["/tf"]["last"]["transforms"]]
    assert frames == [("map", "odom"), ("odom", "base_link")]
    grid = found["/grid"]["first"]["info"] if name == "graph" else {"width": 120, "height": 80}
    assert (grid["width"], grid["height"]) == (120, 80)


@needs_node
def test_the_layout_shows_the_topics_that_runs_write(logs):
    written = set().union(*(read(folder / "result.mcap") for folder in logs.values()))
    layout = json.loads((logs["graph"] / "foxglove_layout.json").read_text())
    panels = layout["configById"]
    shown = set(panels["3D!omninav"]["topics"]) | {panels["Image!omninav"]["imageMode"]["imageTopic"]}
    plotted = [path["value"] for name, panel in panels.items() if name.startswith("Plot!") for path in panel["paths"]]
    assert shown <= written
    assert {value.split(".")[0] for value in plotted} <= written
    assert written - shown <= {"/tf", "/odom", "/similarity/best", "/command"}


@needs_node
def test_foxgloves_client_watches_a_run_and_gets_what_was_sent_before_it_came():
    run, port = small_run(frames=4), free_port()
    server, ctx = WatchRun(viewer=port), Context("watch")
    server.setup(ctx)
    first, *others = shown_of(run, plan=PLAN)
    before = PathSoFar()
    server.step(ctx, before, first)
    client = node("watch.js", str(port), "/grid,/map,/tf,/estimate/pose,/belief")
    assert json.loads(client.stdout.readline())["server"] == "omninav"
    for shown in others:
        server.step(ctx, before, shown)
    found = json.loads(client.communicate(timeout=60)[0].splitlines()[-1])
    assert found["/grid"]["stamp"] == str(run.ticks[0].stamp)
    assert found["/grid"]["first"]["data"]["length"] == 120 * 80
    assert [entry["differences"] for entry in found.values()] == [[]] * 5


def test_a_missing_library_and_a_taken_port_are_one_line(monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(BadInput, match=rf"^watch: 127.0.0.1:{port} cannot be listened on .*watch=PORT[^\n]*$"):
            WatchRun(viewer=port).setup(Context("watch"))
        monkeypatch.setitem(sys.modules, "foxglove", None)
        with pytest.raises(BadInput, match="foxglove-sdk is not installed: pip install 'omninav"):
            WatchRun(viewer=port + 1).setup(Context("watch"))
