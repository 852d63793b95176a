"""From one picture of a path to the next, and how it ends."""

import math

import pytest

from omninav.pipeline import Context, Tick
from omninav.stages.features.rotation_reduced_sift import none_found
from omninav.stages.homing.first_view_path import FirstViewPath, FirstViewPathState
from omninav.stages.homing.waypoint_images import WaypointImages, WaypointImagesState
from omninav.stages.values.homing import HomingVector, ImagePath, PathProgress

PATH = ImagePath(4, tuple(none_found() for _ in range(3)), ("a", "b", "c"))


def vector(number: int, ratio: float = 1.0, **how) -> HomingVector:
    known = {"direction": 0.0, "turn": 0.5, "depth_ratio": ratio, "metres": None, "inliers": 20, "state": "tracking"}
    return HomingVector(number=number, distance=ratio, ratio=ratio, **{**known, **how})


class Path:
    def __init__(self) -> None:
        self.stage, self.along, self.ctx = WaypointImages(), WaypointImagesState(), Context("path")

    def step(self, said: HomingVector | None = None, path: ImagePath | None = PATH) -> WaypointImages.Out:
        return self.stage.step(self.ctx, self.along, path, said)


def test_a_path_is_gone_view_by_view_to_its_last() -> None:
    path = Path()
    first = path.step()
    assert first.target is not None
    assert (first.target.number, first.target.name, first.target.last) == (0, "a", False)
    assert first.features is PATH.views[0]
    assert vars(first.progress) == vars(PathProgress(4, 0, 3, 0, False, False, False))
    assert path.step(vector(0, 0.21)).target.number == 0  # still far
    assert path.step(vector(0, 0.19)).target.name == "b"
    assert path.step(vector(0, 0.01)).target.name == "b"  # of the view before: says nothing of this one
    assert path.step(vector(1, 0.1, state="lost")).target.name == "b"  # lost: nor this
    assert path.step(vector(1, 0.49, direction=1.6)).target.name == "c"  # behind, more than half of the way on
    out = path.step(vector(2, 0.1, depth_ratio=0.0071, metres=0.041))
    assert out.target.last
    assert not out.progress.docking
    out = path.step(vector(2, 0.0069, turn=math.radians(-3.1)))
    assert out.progress.docking
    assert not out.progress.arrived
    out = path.step(vector(2, 0.1, depth_ratio=0.049, turn=math.radians(-2.9)))
    assert out.progress.arrived
    assert out.progress.at == out.progress.of == 3
    assert out.target is None


def test_a_robot_that_doubts_its_target_has_not_arrived() -> None:
    path = Path()
    path.step(path=ImagePath(5, PATH.views[:1], ("a",)))
    one_view = ImagePath(5, PATH.views[:1], ("a",))
    assert path.step(vector(0, 0.005), one_view).progress.docking
    doubtful = path.step(vector(0, 0.005, turn=0.0, state="doubtful"), one_view).progress
    assert (doubtful.docking, doubtful.arrived) == (False, False)
    assert path.step(vector(0, 0.005, turn=0.0), one_view).progress.arrived


def test_a_robot_that_turns_where_its_target_turns_out_to_be_farther_away_drives_on() -> None:
    path, one_view = Path(), ImagePath(5, PATH.views[:1], ("a",))
    path.step(path=one_view)
    assert path.step(vector(0, 0.005, turn=1.0), one_view).progress.docking
    farther = path.step(vector(0, 0.2, depth_ratio=0.051, turn=0.0), one_view).progress
    assert (farther.docking, farther.arrived) == (False, False)


def test_a_view_that_lies_behind_before_half_of_the_way_is_gone_is_not_passed() -> None:
    path = Path()
    path.step()
    assert path.step(vector(0, 0.51, direction=3.0)).target.name == "a"


@pytest.mark.parametrize(
    "there",
    [
        {"ratio": 0.1, "depth_ratio": 0.006},
        {"ratio": 0.1, "depth_ratio": 0.2, "metres": 0.039},
        {"ratio": 0.1, "depth_ratio": 0.029, "direction": 1.6},
    ],
)
def test_the_last_view_is_reached_where_it_is_near_or_just_behind(there) -> None:
    path, one = Path(), ImagePath(1, (none_found(),), ())
    path.step(path=one)
    away = {**there, "depth_ratio": 0.2, "metres": None}
    assert not path.step(vector(0, **{**away, "turn": -0.5}), one).progress.arrived
    assert not path.step(vector(0, **{**there, "depth_ratio": 0.2, "metres": None}), one).progress.docking
    assert path.step(vector(0, **there), one).progress.docking


def test_a_view_that_hardly_differs_from_the_start_is_passed_at_once() -> None:
    path = Path()
    path.step()
    assert path.step(vector(0, 1.0, depth_ratio=0.031)).target.name == "a"
    assert path.step(vector(0, 1.0, depth_ratio=0.029)).target.name == "b"


def test_a_new_path_begins_anew_with_a_target_of_another_number() -> None:
    path = Path()
    path.step()
    path.step(vector(0, 0.1))
    other = ImagePath(5, PATH.views[:2], ("d", "e"))
    out = path.step(vector(1, 0.1), other)
    assert (out.target.name, out.progress.at, out.progress.path) == ("d", 0, 5)
    assert out.target.number == 2


def test_no_path_no_target() -> None:
    path = Path()
    assert path.step(path=None).target is None
    assert path.step(path=ImagePath(1, (), ())).progress is None
    assert path.step(path=ImagePath(0, PATH.views, PATH.names)).target.number == 0


def test_the_first_view_is_given_once_a_second_later() -> None:
    remember, kept, ctx, views = (
        FirstViewPath(),
        FirstViewPathState(),
        Context("remember"),
        [none_found() for _ in range(9)],
    )
    given = [remember.step(ctx, kept, Tick(k, 200_000_000 * k, first_of_log=k == 0), views[k]).path for k in range(9)]
    assert [path is not None for path in given] == [k == 5 for k in range(9)]
    assert given[5].views == (views[0],)
    again = [remember.step(ctx, kept, Tick(k, 200_000_000 * k, log=1), views[k]).path for k in (1, 6)]
    assert again[1].views == (views[1],)  # that of the log's first tick was lost
