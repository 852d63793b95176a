"""Maps of views that are straightened by the places that their drives came back to, and learned again."""

import made_view_maps
import numpy as np
import pytest
from made_ticks import at_tick

from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.geometry.plane.drive_graph import Closures, placed_drives, straightened_drives
from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.mapping.keyframe_history import KeyframeHistory
from omninav.stages.mapping.straightened_sessions import StraightenSessions, closures_between
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.map_update import MapUpdate, MapUpdates
from omninav.stages.values.sessions import Sessions
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import NoveltyThreshold, Spectrum

LAP = np.concatenate([np.tile([0.2, 0.0, 0.0], (24, 1)), np.tile([0.2, 0.0, np.pi / 8], (8, 1))])
TWICE = chain(np.tile(LAP, (4, 1))[:110])  # a stadium, one and three quarters times around
AGAIN = chain(np.tile(LAP, (2, 1)))
AWAY = TWICE[:25] + np.array([50.0, 0.0, 0.0])
WAVES, PHASES = np.random.default_rng(0).normal(0.0, 2.0, (2, 8, 6)), np.linspace(0, 6, 48).reshape(8, 6)
THRESHOLD = NoveltyThreshold(4.0, True, 0.4)


def view(pose):
    """A spectrum of 8 signals that change over half a metre and turn with the robot."""
    size = 1.0 + np.sin(np.tensordot(pose[:2], WAVES, 1) + PHASES)
    spectrum = size * np.exp(1j * (PHASES - np.arange(6) * pose[2]))
    return Spectrum(np.concatenate([spectrum.real.ravel(), spectrum.imag.ravel()]).astype(np.float32), 8, 36)


def drive(sessions, poses, drift=0.01, believed=True):
    """Add a drive by odometry that turns too much by `drift` (rad) at each view."""
    steps = between(poses[:-1], poses[1:]) + np.array([0.0, 0.0, drift])
    sessions = Sessions.empty(view(poses[0])) if sessions is None else sessions
    for row, pose in enumerate(poses):
        if row:
            sessions.move(steps[row - 1])
        sessions.keep(view(pose), pose if believed else None, row == 0, len(sessions))
    return sessions


def at_log(sessions, updates=None, threshold=THRESHOLD, first=True, ticks=None, **options):
    ctx = at_tick(500, first)
    return StraightenSessions(**options).step(ctx, sessions, updates, threshold, ticks), ctx


def straightened(sessions):
    """After the last log."""
    return at_log(sessions, first=False, ticks=[])


def learned(out):
    return np.concatenate([update.state.means for update in out.updates.items])


def error(poses, truth):
    return float(np.hypot(*(poses - truth)[:, :2].T).max())


def test_drives_without_a_common_frame_are_joined_where_they_look_alike():
    sessions = drive(drive(None, TWICE), AGAIN, drift=-0.01, believed=False)
    out, _ = straightened(sessions)
    assert out.metrics.values["straightened"]["joined"] == 2
    assert error(learned(out), np.concatenate([TWICE, AGAIN])) < 0.6


def test_wrong_closures_do_not_bend_the_map():
    sessions = drive(None, TWICE)
    right = closures_between(sessions, 0.6 * THRESHOLD.distance, 2.0, 1000)
    number = round(0.3 / 0.7 * len(right.pairs))
    rng = np.random.default_rng(1)
    wrong = np.sort(np.column_stack([rng.integers(0, 50, number), rng.integers(55, 110, number)]))
    both = Closures(np.concatenate([right.pairs, wrong]), np.append(right.turns, rng.uniform(-3, 3, number)))
    start = compose(TWICE[0], sessions.by_odometry)
    poses, weights = straightened_drives(start, sessions.drives, both, 0.2, 0.1, sessions.motions)
    assert error(poses, TWICE) < 0.4 * error(start, TWICE)
    assert np.median(weights[len(right.pairs) :]) < 0.1 < np.median(weights[: len(right.pairs)])


def test_a_map_of_one_view_stays():
    out, _ = straightened(drive(None, TWICE[:1]))
    assert not out.updates.relearn


def test_sessions_that_were_written_and_read_again_go_on_to_the_same_bytes():
    begun = drive(None, TWICE[:20])
    read = decode(encode(begun))
    assert encode(drive(read, AGAIN)) == encode(drive(begun, AGAIN))


def test_drives_of_which_no_beginning_is_known_are_one_drive():
    sessions = drive(None, TWICE)
    sessions.put(begins=np.zeros(len(sessions), np.bool_))
    assert not sessions.drives.any()
    assert len(straightened(sessions)[0].updates.items) == len(TWICE)


def test_drives_with_other_views_are_not_gone_on_with():
    known = ViewMixtures.empty()
    known.put(sessions=drive(None, TWICE[:3]))
    ctx = at_tick(first=True)
    other = Spectrum(np.ones(8, np.float32), 2, 36)
    state = GaussianMixture(np.zeros((1, 3)), 0.01 * np.eye(3)[None], np.ones(1))
    assert len(KeyframeHistory().step(ctx, other, None, state, None, known).sessions) == 1
    assert len(KeyframeHistory().step(ctx, view(TWICE[0]), None, state, None, known).sessions) == 4
    assert len(known.sessions) == 3


def test_as_a_log_begins_the_map_is_learned_again_from_the_drives_before_it():
    sessions = drive(None, TWICE)
    out, ctx = at_log(sessions)
    assert out.updates.relearn
    assert out.updates.sessions is None
    assert out.updates.open_from is None
    assert out.metrics is None
    assert ctx.facts["map_straightened"].startswith("by ")
    assert [update.index for update in out.updates.items] == sessions.ticks.tolist()
    assert all(update.reconstructed for update in out.updates.items)
    np.testing.assert_array_equal(out.updates.items[7].view.values, sessions.view(7).values)


def test_views_are_learned_with_a_spread():
    item = at_log(drive(None, TWICE))[0].updates.items[0]
    assert item.state.covariances[0] == pytest.approx(np.diag([0.1, 0.1, np.radians(3.0)]) ** 2)
    assert item.state.weights.tolist() == [1.0]


@pytest.mark.parametrize(("look", "way", "closed"), [(5.9, 1.01, True), (6.1, 1.01, False), (5.9, 0.99, False)])
def test_a_loop_closes_within_six_tenths_of_the_threshold_and_five_of_its_ways_further_on(look, way, closed):
    sessions = Sessions.empty(made_view_maps.view(0.0))
    for tick, (each, ahead) in enumerate(((0.0, 0.0), (50.0, way), (look, -way))):
        sessions.move(np.array([ahead, 0.0, 0.0]))
        sessions.keep(made_view_maps.view(each), np.zeros(3), not tick, tick)
    out, _ = at_log(sessions, threshold=NoveltyThreshold(10.0, True, 0.4))
    assert (out.updates is not None) == closed


WAITING = MapUpdates((MapUpdate(view(TWICE[0]), GaussianMixture(np.zeros((1, 3)), np.eye(3)[None], np.ones(1)), 3),), 2)


@pytest.mark.parametrize(
    "left",
    [
        {"first": False},
        {"threshold": None},
        {"threshold": NoveltyThreshold(4.0, False, 0.4)},
        {"threshold": NoveltyThreshold(4.0, True, 0.0)},
        {"max_distance": 0.0},
        {"sessions": None},
        {"sessions": Sessions.empty(view(TWICE[0]))},
    ],
)
def test_else_the_updates_go_on_as_they_came(left):
    sessions = left.pop("sessions") if "sessions" in left else drive(None, TWICE)
    out, ctx = at_log(sessions, WAITING, **left)
    assert out.updates is WAITING
    assert out.metrics is None
    assert not ctx.facts


def test_without_a_crossing_the_last_updates_go_on_with_the_drives_to_be_kept():
    once = drive(None, TWICE[:25])
    out, ctx = at_log(once, WAITING, first=False, ticks=[])
    assert ctx.facts["map_straightened"].startswith("no: ")
    assert (out.updates.items, out.updates.open_from, out.updates.relearn) == (WAITING.items, 2, False)
    assert out.updates.sessions is once
    assert at_log(once, WAITING)[0].updates is WAITING
    assert straightened(once)[0].updates.items == ()


def test_a_drive_elsewhere_stays_and_it_says_how_many_drives_and_closures_there_were_and_by_how_much_views_were_moved():
    sessions = drive(drive(None, TWICE), AWAY)
    out, ctx = straightened(sessions)
    values = out.metrics.values["straightened"]
    moved = np.hypot(*(learned(out) - sessions.believed)[: len(TWICE), :2].T)
    assert (values["sessions"], values["joined"]) == (2, 1)
    np.testing.assert_array_equal(learned(out)[-25:], AWAY)
    assert values["moved_rms_m"] == pytest.approx(np.sqrt(np.mean(moved**2)))
    assert values["moved_max_m"] == pytest.approx(moved.max())
    found = closures_between(sessions, 2.4, 2.0, 1000)
    assert values["closures"] == (found.pairs < len(TWICE)).all(axis=1).sum()
    assert 0 <= values["rejected"] < values["closures"]
    assert ctx.facts["map_straightened"] == (
        f"by {values['closures']} closures between 1 of 2 drives, {values['rejected']} of them rejected, "
        f"{moved.max():.2f} m at most"
    )


def test_of_a_drive_elsewhere_only_what_was_believed_of_one_pose_is_learned():
    sessions = drive(drive(None, TWICE), AWAY, believed=False)
    out, _ = straightened(sessions)
    assert len(learned(out)) == len(TWICE)
    assert straightened(drive(None, TWICE, believed=False))[0].metrics.values["straightened"]["moved_rms_m"] == 0.0


def test_closures_with_a_drive_that_does_not_join_straighten_nothing(monkeypatch):
    sessions = drive(drive(None, TWICE[:25]), AWAY)
    wrong = Closures(np.array([[10, 30]]), np.array([0.3]))
    monkeypatch.setattr("omninav.stages.mapping.straightened_sessions.closures_between", lambda *_: wrong)
    assert at_log(sessions, WAITING)[0].updates is WAITING


def test_closures_of_which_none_is_left_straighten_nothing():
    # Two views far apart that look alike by chance are all there is: odometry knows better.
    poses = TWICE[:25]
    sessions = drive(None, poses)
    looks = sessions.views.copy()
    looks[24] = looks[2]
    sessions.put(views=looks)
    out, ctx = at_log(sessions, WAITING)
    assert len(closures_between(sessions, 2.4, 2.0, 1000).pairs) >= 1
    assert out.updates is WAITING
    assert ctx.facts["map_straightened"].startswith("no: ")


def test_poses_are_those_of_odometry_and_closures_from_where_the_first_drive_was_believed_to_begin():
    # In the threshold's unit of 0.4 m: closures at 2.4 of 4, 2 m along, to within 0.2 m and 5 degrees.
    moved = TWICE + np.array([3.0, -2.0, 0.0])
    sessions = drive(None, moved)
    looks = sessions.views.copy()
    looks[20] = looks[40]  # one that is wrong
    sessions.put(views=looks)
    out, _ = straightened(sessions)
    closures = closures_between(sessions, 0.6 * 4.0, 5.0 * 0.4, 1000)
    start, _ = placed_drives(compose(moved[0], sessions.by_odometry), sessions.drives, closures, 5.0 * 0.4)
    poses, weights = straightened_drives(start, sessions.drives, closures, 0.5 * 0.4, np.radians(5.0), sessions.motions)
    np.testing.assert_array_equal(learned(out), poses)
    assert 0 < (weights < 0.1).sum() < len(weights) - 1
    assert out.metrics.values["straightened"]["rejected"] == (weights < 0.1).sum()
    assert poses[0] == pytest.approx(moved[0], abs=1e-3)
