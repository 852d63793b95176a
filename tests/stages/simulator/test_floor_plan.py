from pathlib import Path

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.recordings.occupancy_grid import boxes, read_grid
from omninav.stages.simulator.floor_plan import FloorPlanOfLog, plan_of
from omninav.stages.simulator.occupancy import write_grid
from omninav.stages.simulator.world import World

CTX = Context("plan")
YAML = "image: map.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def grid(folder: Path, rows: list[list[int]], text: str = YAML) -> Path:
    levels = np.array(rows, np.uint8)
    folder.mkdir(exist_ok=True)
    (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % levels.shape[::-1] + levels.tobytes())
    (folder / "map.yaml").write_text(text)
    return folder / "map.yaml"


def test_a_grid_becomes_boxes_in_the_maps_frame(tmp_path):
    plan = read_grid(grid(tmp_path, [[254, 0, 0], [205, 254, 254]]))  # the picture's lower row lies at the origin
    np.testing.assert_allclose(plan.outlines, [[[-0.5, 2.5], [0.5, 2.5], [0.5, 3.0], [-0.5, 3.0]]])


def test_boxes_cover_what_is_occupied_and_nothing_else():
    occupied = np.random.default_rng(0).random((30, 40)) < 0.4
    covered = np.zeros_like(occupied, int)
    for left, low, right, high in boxes(occupied):
        covered[low:high, left:right] += 1
    np.testing.assert_array_equal(covered, occupied)
    assert len(boxes(np.ones((5, 7), bool))) == 1


def test_the_grid_beside_a_log_is_its_plan(tmp_path):
    log = tmp_path / "drive.mcap"
    log.touch()
    assert FloorPlanOfLog(log=str(log)).step(CTX).plan is None
    assert FloorPlanOfLog(log=str(log)).inputs_digest() is None
    grid(tmp_path, [[0]])
    assert len(FloorPlanOfLog(log=(str(tmp_path / "other"), str(log))).step(CTX).plan.outlines) == 1
    write_grid(World(DEMO, 1), tmp_path / "drive.grid")
    stage = FloorPlanOfLog(log=str(log))
    assert len(stage.step(CTX).plan.outlines) > 5  # its own grid comes before the folder's
    assert stage.inputs_digest() is not None


def test_without_a_log_the_plan_is_the_worlds():
    plan = FloorPlanOfLog(world=DEMO, day=(1, 2)).step(CTX).plan
    np.testing.assert_array_equal(plan.outlines, plan_of(DEMO, 1).outlines)
    assert FloorPlanOfLog(world=None).step(CTX).plan is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("image: none.pgm\n", "map_server"),
        (YAML.replace("map.pgm", "none.pgm"), "none.pgm"),
        (YAML.replace("2.0, 0.0]", "2.0, 0.3]"), "turned by"),
    ],
)
def test_a_grid_that_cannot_be_read_or_is_turned_is_one_clear_line(tmp_path, text, said):
    file = grid(tmp_path, [[0]], text)
    with pytest.raises(BadInput, match=said) as raised:
        read_grid(file)
    assert str(file) in str(raised.value)
