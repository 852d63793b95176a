"""The folder that a localiser of one's own is given, and where it leaves its poses: see docs/peers.md."""

from pathlib import Path

import numpy as np

from omninav.pipeline import BadInput, counted
from omninav.stages.geometry.arrays import Array, Ints

from .camera_yaml import parse_camera
from .recorded_images import RecordedImages
from .stamps import SAME_TIME_S
from .tables import NO_TIME, Time, read_table
from .truth_file import trajectory_rows

POSES = ("poses.csv", "poses.tum")
"""Files of which one holds its poses."""
COST = "cpu_ms"
"""The column of `poses.csv` with the processor time that each image took, which it may have."""


def write_folder(folder: Path, map: RecordedImages, drive: RecordedImages) -> list[Path]:
    """Write what the localiser is given. Returns the files.

    Raises `BadInput` where the map has no image with a pose, and where it is of another camera than the drive.

    `camera.yaml`, and `rays.npy` (height, width, 3): the direction in which each pixel looks, a unit vector of float32
    (x forward, y left, z up), NaN where it sees nothing; `map/images.csv` (file, time, x, y, heading) and
    `drive/images.csv` (file, time, odometry_x, odometry_y, odometry_heading), in seconds, metres and radians, with the
    images beside them. Images of the map whose pose is not known are left out; odometry that is not known is empty.
    """
    placed = np.flatnonzero(np.isfinite(map.truth).all(axis=1))
    if not len(placed):
        raise BadInput("the tour has no true poses, which a localiser of your own is given: truth=FILE names some")
    if map.camera != drive.camera:
        raise BadInput("the tour and the log are of two cameras, or sizes of image; a localiser is given one")
    (folder / "camera.yaml").write_text(drive.camera, encoding="utf-8")
    camera = parse_camera(drive.camera, "camera.yaml")
    rays, _ = camera.unproject(camera.grid())
    np.save(folder / "rays.npy", np.where(camera.mask()[..., None], rays, np.nan).astype(np.float32))
    return [
        folder / "camera.yaml",
        folder / "rays.npy",
        *_write_images(folder / "map", map, map.truth, placed, "file,time,x,y,heading"),
        *_write_images(
            folder / "drive",
            drive,
            drive.odometry,
            np.arange(len(drive)),
            "file,time,odometry_x,odometry_y,odometry_heading",
        ),
    ]


def _write_images(folder: Path, images: RecordedImages, poses: Array, rows: Ints, head: str) -> list[Path]:
    folder.mkdir()
    lines, files = [head], []
    for row in rows.tolist():
        files.append(folder / f"{row:06d}.png")
        files[-1].write_bytes(images.png(row))
        stamp, pose = int(images.stamps[row]), poses[row]
        numbers = [f"{number:.9f}" for number in pose] if np.isfinite(pose).all() else [""] * 3
        lines.append(f"{files[-1].name},{stamp // 10**9}.{stamp % 10**9:09d},{','.join(numbers)}")
    files.append(folder / "images.csv")
    files[-1].write_text("\n".join(lines) + "\n", encoding="utf-8")
    return files


def read_poses(folder: Path, drive: RecordedImages) -> tuple[Array, Array]:
    """Poses (N, 3) that the localiser left, NaN where it gave none; and the processor time of each image (ms).

    `poses.csv` (time, x, y and heading, or qx, qy, qz, qw; perhaps `cpu_ms`) or `poses.tum` (time x y z qx qy qz qw).
    There are as many of these as the file states. Raises `BadInput` where there is no such file, or both, where it
    cannot be read or is doubted, where a row holds half a place, and where one of its times is that of no image, or of
    an image that has a pose.
    """
    files = [folder / name for name in POSES if (folder / name).is_file()]
    if len(files) > 1:
        raise BadInput(f"it left {' and '.join(POSES)}; leave only the one that holds its poses")
    file = next(iter(files), None)
    if file is None:
        raise BadInput(f"it left no {' and no '.join(POSES)} in the folder that it was given; docs/peers.md says how")
    poses = np.full((len(drive), 3), np.nan)
    if not file.stat().st_size:
        return poses, np.empty(0)
    times, rows, impossible, doubts = trajectory_rows(file)
    if impossible:
        raise BadInput(f"{file.name}: {counted(impossible, 'quaternion')} of no rotation")
    if doubts:
        raise BadInput(f"{file.name}: {doubts[0]}")
    placed = np.isfinite(rows[:, :2])
    given = placed.all(axis=1)
    if (half := placed.any(axis=1) & ~given).any():
        where = f"{counted(int(half.sum()), 'row')} with x or y alone, the first at {times[half][0] / 1e9:.6f} s"
        raise BadInput(f"{file.name}: {where}; leave out the row of an image that has no pose")
    times = times[given]
    if (times == NO_TIME).any():
        raise BadInput(f"{file.name}: a pose without a time; it is that of the image in drive/images.csv")
    if len(times) > len(drive):
        raise BadInput(f"{file.name}: {counted(len(times), 'pose')} of {counted(len(drive), 'image')}")
    if np.isnan(rows[given, 2]).any():
        raise BadInput(f"{file.name}: a pose without a heading; leave out the row of an image that has none")
    after = np.searchsorted(drive.stamps, times).clip(0, len(drive) - 1)
    before = (after - 1).clip(0)
    image = np.where(times - drive.stamps[before] <= drive.stamps[after] - times, before, after)
    gap = np.abs(times - drive.stamps[image])
    if (gap > SAME_TIME_S * 1e9).any():
        first, last = drive.stamps[[0, -1]] / 1e9
        wrong = times[gap > SAME_TIME_S * 1e9][0] / 1e9
        raise BadInput(
            f"{file.name}: {wrong:.6f} s is the time of no image of drive/images.csv ({first:.6f} to {last:.6f} s)"
        )
    if len(np.unique(image)) < len(image):
        raise BadInput(f"{file.name}: two poses of one image")
    poses[image] = rows[given]
    return poses, _cost(file)


def _cost(file: Path) -> Array:
    table = read_table(file) if file.suffix == ".csv" else None
    if table is None or COST not in table.names:
        return np.empty(0)
    took = table.nanoseconds(Time(COST, "ms"))
    return took[took >= 0] / 1e6
