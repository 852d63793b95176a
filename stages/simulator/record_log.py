"""Writing a drive through a simulated world as a log, with its floor plan and grid beside it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omninav.pipeline import BadInput, Context, counted
from omninav.stages.recordings.camera_yaml import write_camera

from .config import Kidnapping, WorldConfig
from .occupancy import write_grid
from .plan_image import draw_plan
from .simulated_log import record
from .simulated_recording import SimulatedRecording, in_order
from .world import World


def metres(drive: SimulatedRecording) -> float:
    """Distance (m) that the robot drove, without being carried."""
    steps = np.hypot(*np.diff(drive.true_poses[:, :2], axis=0).T)
    return float(np.delete(steps, drive.carried).sum())


def record_log(
    path: Path,
    world: WorldConfig,
    route: str,
    day: int | tuple[int, ...],
    kidnappings: Sequence[Kidnapping],
    ctx: Context,
) -> None:
    """Write a simulated drive, or one on each of several days: a log, camera.yaml, a floor plan, an occupancy grid.

    Floor plan and grid are those of the first day. The same arguments give the same bytes. Raises
    `UnreadableRecording` for an unknown route, and `BadInput` where the file is a log that was not simulated.
    """
    camera, floor = path.with_suffix(".camera.yaml"), path.with_suffix(".plan.png")
    if path.exists() and not floor.exists():
        raise BadInput(f"log={path}: it is there, and was not simulated; type another name, or delete it")
    days = in_order(day)
    ctx.status(f"building {world.name} and planning {route}")
    drives = [SimulatedRecording(world, route, day, kidnappings) for day in days]
    ctx.status("rendering the first image (a minute if the renderer has to be compiled)")
    record(drives, path, progress=ctx.progress)
    camera.write_text(write_camera(drives[0].camera), encoding="utf-8")
    built = World(world, days[0])
    driven = {f"{route}, day {drive.day}": drive.truth for drive in drives}
    draw_plan(built, floor, driven)
    grid = write_grid(built, path.parent / f"{path.stem}.grid")
    images = sum(len(drive.stamps) for drive in drives)
    collisions = sum(drive.collisions for drive in drives)
    people = [world.day(day).people for day in days]
    for name, value in (
        ("route", route),
        ("day", day),
        ("length_m", round(sum(metres(drive) for drive in drives), 1)),
        ("frames", images),
        ("people", people[0] if len(people) == 1 else people),
        ("collisions", collisions),
    ):
        ctx.fact(name, value)
    if collisions:
        print(f"{path}: the robot touched obstacles {counted(collisions, 'time')}")
    for drive in drives:
        for sentence in drive.warnings:
            ctx.warn(sentence)
        if drive.left_out:
            print(f"{path}: day {drive.day} leaves out what cannot be reached: {', '.join(drive.left_out)}")
        late = drive.kidnappings[len(drive.kidnapped) :]
        if late:
            ends = f"after {(drive.times[-1] - drive.times[0]) / 1e9:.1f} s, the robot is not carried at"
            ctx.warn(f"{path}: day {drive.day} ends {ends} {', '.join(f'{each.at:g}' for each in late)} s")
    print(f"{path}: {counted(images, 'image')}; beside it {camera.name}, {floor.name} and {grid}")
