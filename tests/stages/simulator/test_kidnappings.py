"""What befalls a simulated drive: liftings, pictures lost or late, ranges; in its log as in itself."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline import BadInput, Context
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.geometry.plane.se2 import between, wrap
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Topics, UnreadableRecording
from omninav.stages.simulator.cameras import camera_rays
from omninav.stages.simulator.config import (
    Day,
    Delivery,
    Door,
    Kidnapping,
    OdometryNoise,
    Room,
    Route,
    Sensor,
    WorldConfig,
    mirror,
)
from omninav.stages.simulator.record_log import metres, record_log
from omninav.stages.simulator.renderer import render
from omninav.stages.simulator.simulated_log import record
from omninav.stages.simulator.simulated_recording import SimulatedRecording
from omninav.stages.simulator.world import World
from omninav.stages.source.log import LogSource
from omninav.stages.source.playback import PlaybackState
from omninav.stages.source.simulated import SimulatedSource

SMALL = mirror(columns=80)
WORLD = replace(
    DEMO,
    camera=SMALL,
    routes={"there": Route(waypoints=((2.0, 1.5), (6.0, 1.5)))},
    delivery=Delivery(dropped=0.15, late=0.2, delay_s=0.7),
)
KIDNAPPED = (Kidnapping(at=3.03, turn=1.0), Kidnapping(at=5.0, to=(5.0, 1.4, 0.2)))
EXACT = replace(WORLD, odometry=OdometryNoise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0), delivery=Delivery())


@pytest.fixture(scope="module")
def drive() -> SimulatedRecording:
    return SimulatedRecording(WORLD, "there", 1, KIDNAPPED)


@pytest.fixture(scope="module")
def log(drive: SimulatedRecording, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("kidnappings") / "drive.mcap"
    record(drive, path)
    return path


def test_a_lifted_robot_is_elsewhere_in_the_truth_and_nowhere_else():
    """Between its pictures truth moves by what odometry says, but for the two leaps."""
    drive = SimulatedRecording(EXACT, "there", 1, KIDNAPPED)
    off = between(drive.truth[:-1], drive.truth[1:]) - between(drive.odometry[:-1], drive.odometry[1:])
    off[:, 2] = wrap(off[:, 2])
    leaps = np.flatnonzero(np.abs(off).max(axis=1) > 1e-6)
    moments = drive.stamps[leaps] - drive.times[0]
    assert [round(moment / 1e9, 2) for moment in moments] == [3.02, 4.52]
    assert off[leaps[0], 2] == pytest.approx(1.0)


def test_the_way_that_a_robot_is_carried_is_not_driven():
    way = [metres(SimulatedRecording(EXACT, "there", 1, lifts)) for lifts in ((), KIDNAPPED[:1])]
    assert way[1] == pytest.approx(way[0], abs=0.2)
    carried = SimulatedRecording(EXACT, "there", 1, (Kidnapping(at=3.0, to=(2.0, 1.5, 0.0)),))
    leap = np.hypot(*np.diff(carried.true_poses[:, :2], axis=0)[carried.carried].T)
    assert metres(carried) + leap.sum() == pytest.approx(np.hypot(*np.diff(carried.true_poses[:, :2], axis=0).T).sum())
    assert leap[0] > 0.3


def test_a_routes_own_events_come_with_it_and_others_on_top():
    route = replace(EXACT.routes["there"], kidnappings=KIDNAPPED[:1])
    drive = SimulatedRecording(replace(EXACT, routes={"there": route}), "there", 1, KIDNAPPED[1:])
    whole = SimulatedRecording(EXACT, "there", 1, KIDNAPPED)
    assert drive.kidnappings == KIDNAPPED
    np.testing.assert_array_equal(drive.driven, whole.driven)


def test_who_is_put_down_beside_laps_goes_on_with_the_lap_that_was_begun():
    """A triangle of 12 m, three times: who is carried ahead on the first lap has most of it left, and two more."""
    laps = Route(kind="laps", waypoints=((2.0, 1.5), (5.0, 1.5), (5.0, 5.5)), laps=3)
    world = replace(EXACT, shelves=(), blocks=(), wall_panels=(), routes={"laps": laps})
    plain, carried = (
        SimulatedRecording(world, "laps", 1, kidnappings)
        for kidnappings in ((), (Kidnapping(at=4.0, to=(5.0, 4.5, 1.57)),))
    )
    way = [float(np.hypot(*np.diff(drive.rolled[:, :2], axis=0).T).sum()) for drive in (plain, carried)]
    assert 2.0 < way[0] - way[1] < 6.0  # what it was carried over, but no lap


def test_a_long_drive_sees_the_light_and_the_goods_of_several_days():
    days = (Day(), Day(rearranged=0.5), Day(light=(0.5, 0.5, 0.5)))
    still = replace(EXACT, days=days, timing=replace(EXACT.timing, images=1.0), sensor=Sensor(noise=0.0))
    lasting = replace(still, routes={"there": replace(still.routes["there"], day_duration_s=3.0)})
    drive, same_day = SimulatedRecording(lasting, "there", 0), SimulatedRecording(still, "there", 0)
    rays = camera_rays(drive.camera, still.sensor.vignetting, still.robot.radius)
    for frame, day in ((0, 0), (2, 0), (4, 1), (7, 2)):
        seconds = (drive.stamps[frame] - drive.times[0]) * 1e-9
        assert int(seconds // 3.0) == day
        exposure = 1.0 + 0.04 * math.sin(2 * math.pi * seconds / still.sensor.exposure_period)
        as_that_day = render(World(still, day).scene, rays, drive.truth[frame : frame + 1], 0.9, exposure)
        np.testing.assert_array_equal(drive.image(frame), as_that_day)
        assert np.array_equal(drive.image(frame), same_day.image(frame)) == (day == 0)


def test_what_a_robot_may_run_into_does_not_change_while_it_drives():
    lasting = replace(EXACT.routes["there"], day_duration_s=3.0)
    world = replace(EXACT, days=(Day(), Day(furniture=0.1)), routes={"there": lasting})
    with pytest.raises(UnreadableRecording, match="route 'there' lasts several days, and on one of world"):
        SimulatedRecording(world, "there", 0)


def test_no_picture_is_taken_on_the_way_from_one_place_to_the_other():
    pictures = replace(EXACT, timing=replace(EXACT.timing, images=100.0))
    drive = SimulatedRecording(pictures, "there", 1, (Kidnapping(at=5.0, to=(5.0, 1.4, 0.2)),))
    steps = np.hypot(*np.diff(drive.truth[:, :2], axis=0).T)
    assert (steps > 0.01).sum() == 1


def test_a_log_holds_truth_up_to_the_leap_and_from_it_on(drive: SimulatedRecording, log: Path):
    assert len(drive.true_times) == len(drive.times) + 2
    found = open_recording(str(log))
    np.testing.assert_array_equal(found.stamps, drive.stamps)
    np.testing.assert_allclose(found.truth, drive.truth, atol=1e-9)  # type: ignore[arg-type]
    np.testing.assert_allclose(found.odometry, drive.odometry, atol=1e-9)  # type: ignore[arg-type]
    kidnappings = [json.loads(message.content.data) for message in LogReader(log).messages(["/ground_truth/event"])]
    assert [event["at"] for event in kidnappings] == [3.03, 5.0]
    assert kidnappings[1]["to"] == [5.0, 1.4, 0.2]


@pytest.fixture(scope="module")
def undisturbed() -> SimulatedRecording:
    """The same drive, of which every image arrives in time."""
    return SimulatedRecording(replace(WORLD, delivery=Delivery()), "there", 1, KIDNAPPED)


def test_lost_images_are_missing_and_overtaken_ones_are_counted(
    drive: SimulatedRecording, undisturbed: SimulatedRecording, log: Path
):
    assert 0 < len(drive.sent) < len(undisturbed.stamps)
    assert len(drive.stamps) == len(drive.sent) - drive.dropped["backward_stamp"]
    assert drive.dropped["backward_stamp"] > 0
    assert open_recording(str(log)).dropped == drive.dropped
    assert (np.diff(drive.stamps) > 0).all()


def test_losing_images_does_not_change_those_that_arrive(drive: SimulatedRecording, undisturbed: SimulatedRecording):
    frame = int(np.flatnonzero(undisturbed.stamps == drive.stamps[5])[0])
    assert frame > 5
    np.testing.assert_array_equal(undisturbed.image(frame), drive.image(5))
    np.testing.assert_array_equal(undisturbed.rolled, drive.rolled)


def test_ranges_come_back_from_the_log_as_they_were_before_each_picture(drive: SimulatedRecording, log: Path):
    found = open_recording(str(log))
    for frame in (0, 4, len(drive.stamps) - 1):
        wanted, read = drive.scan(frame), found.scan(frame)
        assert wanted is not None
        assert read is not None
        np.testing.assert_array_equal(read.ranges, wanted.ranges)
        np.testing.assert_allclose(read.azimuths(), wanted.azimuths(), atol=1e-6)
        assert (read.nearest, read.farthest) == (wanted.nearest, wanted.farthest)


def test_the_log_source_gives_ranges_with_each_tick_and_does_without(log: Path):
    def first(**parameters: object) -> LogSource.Out:
        source, ctx = LogSource(log=str(log), **parameters), Context("source")  # type: ignore[arg-type]
        source.setup(ctx)
        out = source.step(ctx, PlaybackState())
        assert out is not None
        return out

    assert first().scan is not None
    assert first(topics=Topics(scan=None)).scan is None
    with pytest.raises(UnreadableRecording, match=r"no topic /sonar; type topics\.scan=null"):
        first(topics=Topics(scan="/sonar"))
    with pytest.raises(UnreadableRecording, match="/odom carries nav_msgs/msg/Odometry, not sensor_msgs"):
        first(topics=Topics(scan="/odom"))


def test_the_same_events_give_the_same_bytes_and_others_another_drive(
    drive: SimulatedRecording, log: Path, tmp_path: Path
):
    record(SimulatedRecording(WORLD, "there", 1, KIDNAPPED[::-1]), tmp_path / "again.mcap")
    assert (tmp_path / "again.mcap").read_bytes() == log.read_bytes()
    assert SimulatedRecording(WORLD, "there", 1).digest() != drive.digest()


def test_added_noise_makes_a_days_odometry_worse():
    def drift(added: tuple[float, float, float]) -> float:
        world = replace(EXACT, odometry=replace(EXACT.odometry, added=added))
        drive = SimulatedRecording(world, "there", 1)
        return float(np.abs(wrap(drive.odometry[:, 2] - (drive.truth[:, 2] - drive.truth[0, 2]))).max())

    assert drift((0.0, 0.0, 0.0)) < 0.01
    assert drift((20.0, 20.0, 20.0)) > 0.1


def test_several_days_in_one_log_are_read_as_one_drive_after_another(tmp_path: Path):
    days = [SimulatedRecording(replace(WORLD, delivery=Delivery()), "there", day) for day in (0, 2)]
    record(days, tmp_path / "days.mcap")

    def ticks(source: LogSource | SimulatedSource) -> list[LogSource.Out | SimulatedSource.Out]:
        ctx, position, outs = Context("source"), PlaybackState(), []
        source.setup(ctx)
        while (out := source.step(ctx, position)) is not None:
            outs.append(out)
        assert len(outs) == source.length()
        return outs

    read = ticks(LogSource(log=str(tmp_path / "days.mcap")))
    driven = ticks(SimulatedSource(world=replace(WORLD, delivery=Delivery()), route="there", day=(2, 0)))
    assert [out.tick.log for out in read] == [0] * len(days[0].stamps) + [1] * len(days[1].stamps)
    assert [out.motion is None for out in read] == [out.tick.first_of_log for out in read]
    assert sum(out.tick.first_of_log for out in read) == 2
    for one, other in zip(read, driven, strict=True):
        assert vars(one.tick) == vars(other.tick) | {"frame": one.tick.frame}
        assert one.motion is None or vars(one.motion) == pytest.approx(vars(other.motion), abs=1e-9)


def test_days_that_cannot_be_are_refused():
    with pytest.raises(UnreadableRecording, match=r"days are numbered from 0; type day=1 or day=\[0,1,2\]"):
        SimulatedSource(world=WORLD, route="there", day=(0, -1)).setup(Context("source"))


def test_what_a_written_log_states_does_not_count_the_metres_it_was_carried(tmp_path: Path) -> None:
    """Wheels without errors know how far they rolled, and nothing of being lifted."""
    said = Context("record")
    record_log(tmp_path / "out.mcap", EXACT, "there", (0, 1), KIDNAPPED, said)
    drives = [SimulatedRecording(EXACT, "there", day, KIDNAPPED) for day in (0, 1)]
    rolled = sum(np.hypot(*np.diff(drive.rolled[:, :2], axis=0).T).sum() for drive in drives)
    jumped = sum(np.hypot(*np.diff(drive.true_poses[:, :2], axis=0).T).sum() for drive in drives)
    assert said.facts.pop("length_m") == pytest.approx(rolled, abs=0.06)
    assert jumped > rolled + 0.5
    assert said.facts == {
        "route": "there",
        "day": (0, 1),
        "frames": sum(len(drive.stamps) for drive in drives),
        "people": [EXACT.day(0).people, EXACT.day(1).people],
        "collisions": sum(drive.collisions for drive in drives),
    }


def test_a_kidnapping_after_the_end_of_the_drive_is_told(tmp_path: Path):
    said = Context("simulate")
    record_log(tmp_path / "out.mcap", EXACT, "there", 1, (*KIDNAPPED, Kidnapping(at=600.0, turn=1.0)), said)
    assert [warning.rpartition(", ")[2] for warning in said.warnings] == ["the robot is not carried at 600 s"]


def test_rooms_and_points_behind_closed_doors_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    den = Room("den", (0.0, 0.0), (3.0, 3.0), (Door("north", 1.5),))
    routes = {"all": Route(((4.0, 1.0), (1.5, 2.0), (6.0, 1.0)), "rooms")}
    world = WorldConfig(rooms=(den,), routes=routes, camera=SMALL, days=(Day(doors=0.0),))
    record_log(tmp_path / "out.mcap", world, "all", 0, (), Context("simulate"))
    assert "out.mcap: day 0 leaves out what cannot be reached: den, (1.5, 2) in den\n" in capsys.readouterr().out


def test_a_drive_that_skips_most_of_its_route_and_a_plan_that_is_not_drawn_are_told(tmp_path: Path):
    lap = Route(((2.0, 1.0), (9.0, 1.0), (9.0, 2.0), (2.0, 2.0)), "laps", laps=3)
    skips = replace(EXACT, plan="drawn", routes={"lap": lap}, robot=replace(EXACT.robot, look_ahead=12.0))
    source, simulate = Context("source"), Context("simulate")
    SimulatedSource(world=skips, route="lap", day=0).setup(source)
    record_log(tmp_path / "out.mcap", skips, "lap", 0, (), simulate)
    assert simulate.warnings == source.warnings
    one_plan, short = simulate.warnings
    assert "one plan" in one_plan
    assert "the robot drove " in short
    assert SimulatedRecording(EXACT, "there", 0, KIDNAPPED).warnings == []


def test_a_log_that_was_not_simulated_is_not_written_over(tmp_path: Path):
    (tmp_path / "mine.mcap").write_bytes(b"precious")
    with pytest.raises(BadInput, match=r"mine\.mcap: it is there, and was not simulated"):
        record_log(tmp_path / "mine.mcap", EXACT, "there", 1, (), Context("simulate"))
    assert (tmp_path / "mine.mcap").read_bytes() == b"precious"


@pytest.mark.parametrize("waypoints", [((2.0, 1.5),), ((2.0, 1.5), (2.0, 1.5))])
def test_a_route_that_leads_nowhere_is_refused_and_leaves_no_file(
    waypoints: tuple[tuple[float, float], ...], tmp_path: Path
) -> None:
    world = replace(EXACT, routes={"one": Route(waypoints)})
    with pytest.raises(UnreadableRecording, match=f"route 'one' of world '{world.name}' ends before its first image"):
        record_log(tmp_path / "w.mcap", world, "one", 1, (), Context("simulate"))
    assert not list(tmp_path.iterdir())
