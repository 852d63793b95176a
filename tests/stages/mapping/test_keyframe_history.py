"""Which views of a drive are kept, with which motion and which pose."""

import numpy as np
import pytest
from made_ticks import at_tick
from made_view_maps import learned, view

from omninav.stages.mapping.keyframe_history import KeyframeHistory
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.pose import Motion
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.view_mixtures import ViewMixtures

AHEAD = Motion(0.3, 0.0, 0.0)


def believed(*places: float, sigma_rad: float = 0.1, weights: tuple[float, ...] = (1.0,)) -> GaussianMixture:
    means = np.array([[x, 0.0, 0.5] for x in places]).reshape(-1, 3)
    covariances = np.repeat(np.diag([0.01, 0.01, sigma_rad**2])[None], len(places), axis=0)
    return GaussianMixture(means, covariances, np.array(weights[: len(places)]))


def keep(
    sessions: Sessions | None,
    tick: int,
    motion: Motion | None,
    state: GaussianMixture | None = None,
    first: bool = False,
    known: ViewMixtures | None = None,
    stage: KeyframeHistory | None = None,
) -> Sessions:
    state = believed(1.0) if state is None else state
    kept = (stage or KeyframeHistory()).step(at_tick(tick, first), view(tick), motion, state, sessions, known).sessions
    assert kept is not None
    return kept


def test_a_view_has_the_odometry_since_the_one_before_and_none_where_a_drive_begins() -> None:
    sessions = keep(None, 3, None, first=True)
    keep(sessions, 4, Motion(0.0, 0.0, np.pi / 2))  # in place: not kept, but counted
    keep(sessions, 5, AHEAD)
    keep(sessions, 6, None)  # a gap of the odometry
    keep(sessions, 7, AHEAD, first=True)
    assert sessions.views[:, 0, 0].tolist() == [3.0, 5.0, 6.0, 7.0]
    assert sessions.ticks.tolist() == [3, 5, 6, 7]
    assert sessions.begins.tolist() == [True, False, True, True]
    assert sessions.motions == pytest.approx(
        np.array([[0, 0, 0], [0, 0.3, np.pi / 2], [0, 0, 0], [0, 0, 0]]), abs=1e-12
    )


def test_small_ways_add_up_in_both_directions(monkeypatch: pytest.MonkeyPatch) -> None:
    sessions = keep(None, 0, None, first=True)
    for tick in range(1, 8):
        monkeypatch.setattr("omninav.stages.mapping.keyframe_history.MIN_MOVE_M", 0.0149)
        keep(sessions, tick, Motion(0.003, 0.004, 0.0), stage=KeyframeHistory())
    assert sessions.ticks.tolist() == [0, 3, 6]
    assert sessions.since == pytest.approx([0.003, 0.004, 0.0])
    monkeypatch.setattr("omninav.stages.mapping.keyframe_history.MIN_MOVE_M", 0.0)
    keep(sessions, 8, Motion(0.0, 0.0, 0.0), stage=KeyframeHistory())
    assert sessions.ticks.tolist() == [0, 3, 6, 8]


@pytest.mark.parametrize(
    ("state", "pose"),
    [
        (believed(2.0), [2.0, 0.0, 0.5]),
        (believed(2.0, sigma_rad=np.radians(44.9)), [2.0, 0.0, 0.5]),
        (believed(2.0, sigma_rad=np.radians(45.0)), [2.0, 0.0, 0.5]),
        (believed(2.0, sigma_rad=np.radians(45.1)), None),
        (believed(2.0, 9.0, weights=(0.5, 0.5)), None),
        (believed(), None),
    ],
)
def test_a_pose_is_kept_where_one_is_believed(state: GaussianMixture, pose: list[float] | None) -> None:
    sessions = keep(None, 0, None, state, first=True)
    assert sessions.sure.tolist() == [pose is not None]
    assert sessions.believed[0].tolist() == (pose or [0.0, 0.0, 0.0])


def test_drives_of_a_known_map_come_first_and_are_of_no_tick() -> None:
    known = ViewMixtures.empty()
    known.put(sessions=keep(keep(None, 4, None, first=True), 5, AHEAD))
    grown = keep(None, 2, AHEAD, first=True, known=known)
    assert grown.views[:, 0, 0].tolist() == [4.0, 5.0, 2.0]
    assert grown.ticks.tolist() == [0, 0, 2]
    assert grown.drives.tolist() == [0, 0, 1]
    assert known.sessions is not None
    assert known.sessions.ticks.tolist() == [4, 5]
    assert len(keep(None, 2, None, first=True, known=ViewMixtures.empty())) == 1


def test_a_known_map_without_drives_keeps_none_so_that_it_is_not_forgotten() -> None:
    known = learned(1.0)
    ctx = at_tick(2, first=True)
    out = KeyframeHistory().step(ctx, view(2), None, believed(1.0), None, known)
    assert out.sessions is None
    assert ctx.facts["map_straightened"] == "no: the map it continued was saved without its drives"
