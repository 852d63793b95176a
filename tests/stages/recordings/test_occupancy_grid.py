"""Occupancy grids from files and from the built-in world."""

from pathlib import Path

import numpy as np
import pytest
from conftest import DATA, needs_data
from landmark_tour import graph_of
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.recordings.occupancy_grid import boxes, coarser, grid_beside, read_grid, read_occupancy
from omninav.stages.simulator.occupancy import write_grid
from omninav.stages.simulator.world import World
from omninav.stages.simulator.world_grid import WorldGrid
from omninav.stages.source.occupancy_grid_loader import OccupancyGridLoader
from omninav.stages.values.grid import FREE, OCCUPIED, UNKNOWN, FreeSpace, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph

from .conftest import refused

YAML = "image: map.pgm\nresolution: 0.5\norigin: [-1.0, 2.0, 0.0]\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
CTX = Context("grid")


def written(folder: Path, rows: list[list[int]], text: str = YAML) -> Path:
    levels = np.array(rows, np.uint8)
    folder.mkdir(exist_ok=True, parents=True)
    (folder / "map.pgm").write_bytes(b"P5\n%d %d\n255\n" % levels.shape[::-1] + levels.tobytes())
    (folder / "map.yaml").write_text(text)
    return folder / "map.yaml"


def states_at(grid: OccupancyGrid, points: np.ndarray) -> np.ndarray:
    rows, columns = grid.cells_of(points).T
    return grid.cells[rows, columns]


def a_map(*places: tuple[float, float]) -> ReferenceGraph:
    return graph_of(np.array([(*place, 0.0) for place in places]))


# map_server's rule: p = (255 - level) / 255 is compared with the thresholds; 205 is 0.1961, just above free_thresh.
@pytest.mark.parametrize(
    ("more", "levels", "states"),
    [
        ("", [0, 205, 206, 254], [OCCUPIED, UNKNOWN, FREE, FREE]),
        ("negate: 1\n", [0, 49, 50, 255], [FREE, FREE, UNKNOWN, OCCUPIED]),
        ("occupied_thresh: 0.5\nfree_thresh: 0.25\n", [127, 128, 191, 192], [OCCUPIED, UNKNOWN, UNKNOWN, FREE]),
        ("mode: raw\n", [19, 20, 65, 66, 100, 101], [FREE, UNKNOWN, UNKNOWN, OCCUPIED, OCCUPIED, UNKNOWN]),
        ("mode: scale\n", [0, 128, 205, 254], [OCCUPIED, UNKNOWN, UNKNOWN, FREE]),
    ],
)
def test_levels_are_read_as_map_server_reads_them(tmp_path, more, levels, states):
    grid = read_occupancy(written(tmp_path, [levels], YAML.partition("occupied")[0] + more))
    assert grid.cells.tolist() == [states]
    assert grid.made_from == "map"


def test_row_0_is_the_images_last_and_cells_are_found_by_their_points(tmp_path):
    grid = read_occupancy(written(tmp_path, [[254, 0], [205, 254]]))
    assert grid.cells.tolist() == [[UNKNOWN, FREE], [FREE, OCCUPIED]]
    assert grid.origin == (-1.0, 2.0)
    points = np.array([[-0.9, 2.1], [-0.4, 2.9], [-0.4, 3.1]])
    assert grid.cells_of(points).tolist() == [[0, 0], [1, 1], [2, 1]]
    assert states_at(grid, points[:2]).tolist() == [UNKNOWN, OCCUPIED]
    assert grid.centres(np.array([1]), np.array([0])).tolist() == [[-0.75, 2.75]]


def test_runs_that_stand_in_the_next_row_as_well_are_one_box(tmp_path):
    rows = [[0, 0, 254, 0, 0], [0, 0, 254, 254, 0]]  # the lower one first
    assert sorted(boxes(np.array(rows) == 0).tolist()) == [[0, 0, 2, 2], [3, 0, 5, 1], [4, 1, 5, 2]]
    plan = read_grid(written(tmp_path, [rows[1], [254, 254, 0, 254, 254]]))
    # one cell of half a metre, from (-1, 2) on two to the right
    assert plan.outlines.shape == (3, 4, 2)
    assert [[0.0, 2.0], [0.5, 2.0], [0.5, 2.5], [0.0, 2.5]] in plan.outlines.tolist()
    assert (plan.width, plan.depth) == (1.5, 3.0)


def test_a_coarser_cell_is_occupied_where_any_of_its_cells_is_else_unknown_where_any_is():
    fine = np.zeros((4, 5), np.uint8)
    fine[0, 0], fine[1, 1], fine[3, 0] = OCCUPIED, UNKNOWN, UNKNOWN
    grid = coarser(OccupancyGrid(fine, 0.05, (1.0, 2.0)), 0.09)
    # the last column is half a cell outside of the grid, which is unknown
    assert grid.cells.tolist() == [[OCCUPIED, FREE, UNKNOWN], [UNKNOWN, FREE, UNKNOWN]]
    assert (grid.resolution, grid.origin) == (0.1, (1.0, 2.0))
    assert coarser(grid, 0.05) is grid


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("mode: pretty\n", r"mode: 'pretty' .* 'trinary' \| 'scale' \| 'raw'"),
        ("negate: 7\n", "negate: 7 .* expected bool"),
        ("image: [\n", "not valid YAML"),
        ("image: other.pgm\n", "line 6: the key 'image' occurs twice"),
    ],
)
def test_a_map_that_cannot_be_read_is_one_line_that_names_the_file(tmp_path, text, said):
    file = written(tmp_path, [[0]], YAML + text)
    with refused(f"{file}.*{said}"):
        read_occupancy(file)


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        ("resolution", "1e-9", "resolution: 1e-09 is out of bounds"),
        ("resolution", ".inf", "line 2: '.inf' is not finite"),
        ("resolution", "0", "resolution: 0.0 is out of bounds"),
        ("resolution", "fine", r"resolution: 'fine' \(str\), expected float"),
        ("origin", "[1, 2]", "origin: .* expected"),
        ("origin", "[1.0e+300, 2, 0]", "out of bounds"),
        ("origin", "[1, 2, 0.1]", r"turned by 0\.1 rad"),
        ("occupied_thresh", "7", "occupied_thresh: 7.0 is out of bounds"),
        ("image", "/dev/zero", "/dev/zero: this is a device, expected a file"),
        ("image", ".", "this is a folder, expected a file"),
        ("image", "x" * 300, "File name too long"),
        ("image", "map.yaml", "its image map.yaml cannot be read"),
    ],
)
def test_values_without_bounds_are_refused_by_name(tmp_path, key, value, said):
    text = "".join(f"{key}: {value}\n" if line.startswith(f"{key}:") else f"{line}\n" for line in YAML.splitlines())
    file = written(tmp_path, [[254]], text)
    with refused(said):
        OccupancyGridLoader(grid=str(file), log="drive.mcap").inputs_digest()


def test_a_grid_that_leaves_no_room_is_refused_before_anything_runs(tmp_path):
    with refused(r"no cell is free and 0\.2 m from obstacles"):
        OccupancyGridLoader(grid=str(written(tmp_path, [[0, 0]]))).inputs_digest()


def test_another_image_is_another_grid(tmp_path, monkeypatch):
    monkeypatch.setattr("omninav.stages.source.occupancy_grid_loader.CLEARANCE_M", 0.0)
    file = written(tmp_path, [[254, 254]])
    first = OccupancyGridLoader(grid=str(file)).inputs_digest()
    written(tmp_path, [[254, 0]])
    assert OccupancyGridLoader(grid=str(file)).inputs_digest() != first


def test_the_files_grid_comes_in_cells_of_the_wanted_size(tmp_path, monkeypatch):
    monkeypatch.setattr("omninav.stages.source.occupancy_grid_loader.CLEARANCE_M", 0.0)
    file = written(tmp_path, [[254] * 8] * 6)
    stage = OccupancyGridLoader(grid=str(tmp_path), log="drive.mcap", resolution_m=1.0)
    out = stage.step(CTX)
    assert out.grid.cells.shape == (3, 4)
    assert len(out.free.centres) == 12
    assert stage.inputs_digest() == OccupancyGridLoader(grid=str(file)).inputs_digest()


def test_poses_are_drawn_evenly_over_the_free_cells_with_all_headings():
    space = FreeSpace(np.array([[0.5, 0.5], [2.5, 0.5]]), 1.0)
    poses = space.draw(np.random.default_rng(0), 40_000)
    x = poses[:, 0]
    assert ((x < 1) | (x >= 2)).all()
    # shares of quarters of the area and of the circle: 1/4 each, to four standard errors
    error = 4 * (0.25 * 0.75 / 40_000) ** 0.5
    for low in (0.0, 0.5, 2.0, 2.5):
        assert ((x >= low) & (x < low + 0.5)).mean() == pytest.approx(0.25, abs=error)
    for low in np.arange(4) * np.pi / 2 - np.pi:
        assert ((poses[:, 2] >= low) & (poses[:, 2] < low + np.pi / 2)).mean() == pytest.approx(0.25, abs=error)


def test_without_a_log_it_is_the_worlds_own_grid_as_it_would_be_written(tmp_path):
    known = WorldGrid(world=DEMO, resolution_m=0.1).step(CTX).grid
    out = OccupancyGridLoader(resolution_m=0.1).step(CTX, known)
    read = read_occupancy(write_grid(World(DEMO, 0), tmp_path, 0.1))
    assert out.grid.made_from == "world"
    np.testing.assert_array_equal(out.grid.cells, read.cells)
    assert OccupancyGridLoader().inputs_digest() is None
    with refused(r"grid: none is named; give grid=FOLDER/map.yaml"):
        OccupancyGridLoader().step(CTX)


def test_a_world_gives_no_grid_of_a_log_or_beside_one_that_is_named():
    assert WorldGrid(world=DEMO, log="drive.mcap").step(CTX).grid is None
    assert WorldGrid(world=DEMO, grid="from_tour").step(CTX).grid is None


def test_a_log_without_a_grid_says_what_is_missing_and_how_to_get_one(tmp_path):
    with refused(r"grid=FOLDER/map.yaml .* grid=from_tour"):
        OccupancyGridLoader(log=str(tmp_path / "drive.mcap")).inputs_digest()
    with refused(r"none.yaml is no file"):
        OccupancyGridLoader(grid=str(tmp_path / "none.yaml")).inputs_digest()
    written(tmp_path / "tour.grid", [[0]])
    (tmp_path / "tour.mcap").touch()
    with refused(f"grid={tmp_path}/tour.grid/map.yaml"):
        OccupancyGridLoader(log=str(tmp_path / "drive.mcap"), tour=str(tmp_path / "tour.mcap")).step(CTX)
    both = [str(tmp_path / "drive.mcap"), str(tmp_path / "tour.mcap")]
    beside = written(tmp_path, [[0]])  # of all logs of the folder that are there
    assert grid_beside(both) == tmp_path / "tour.grid" / "map.yaml"
    (tmp_path / "drive.mcap").touch()
    assert grid_beside(both) == beside


def test_references_beside_the_free_space_leave_all_of_it_and_are_told_of(tmp_path, monkeypatch):
    monkeypatch.setattr("omninav.stages.source.occupancy_grid_loader.CLEARANCE_M", 0.0)
    ctx = Context("grid")
    written(tmp_path, [[254] * 4] * 4)
    out = OccupancyGridLoader(grid=str(tmp_path), resolution_m=0.5).step(ctx, map=a_map((50.0, 50.0)))
    assert len(out.free.centres) == 16
    assert "1 of the map's 1 references are not in free cells" in ctx.warnings[0]


@pytest.mark.parametrize(("off", "warned"), [(1, []), (2, ["2 of the map's 10 references are not in free cells"])])
def test_a_grid_in_whose_free_cells_a_map_does_not_lie_is_told_of(tmp_path, monkeypatch, off, warned):
    monkeypatch.setattr("omninav.stages.source.occupancy_grid_loader.CLEARANCE_M", 0.0)
    ctx = Context("grid")
    written(tmp_path, [[254, 254, 0, 205]])
    places = [(-0.75, 2.25)] * (10 - off) + [(0.25, 2.25), (0.75, 2.25)][:off]
    OccupancyGridLoader(grid=str(tmp_path), resolution_m=0.5).step(ctx, map=a_map(*places))
    assert [warning.partition(" of the grid")[0] for warning in ctx.warnings] == warned


@needs_data
def test_the_whole_tour_of_a_real_recording_lies_in_its_free_cells():
    house = DATA / "photoreal-house"
    truth = np.loadtxt(house / "tour_truth.tum")[:, 1:3]
    grid = coarser(read_occupancy(house / "map.yaml"), 0.1)
    assert (states_at(grid, truth) == FREE).all()
