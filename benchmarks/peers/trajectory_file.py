"""Poses that another program left in a file: RTAB-Map, stella_vslam, VT&R and whatever evo reads.

omninav variant=peer command="python benchmarks/peers/trajectory_file.py frame_trajectory.txt" tour=a.mcap log=b.mcap

Lines of 8 numbers are TUM's (time x y z qx qy qz qw), of 9 RTAB-Map's with an id behind them, and of 12 KITTI's 3 x 4
matrices, one for each image of the drive. Poses are of the robot, x forward and z up, or with `camera` as a second word
of a camera that looks forward (x right, y down, z forward); they are in the map's frame.
"""

import sys
from pathlib import Path

import numpy as np
from given import FOLDER, images

file, axes = sys.argv[1], "camera" in sys.argv[2:-1]
_, times, _ = images("drive")
rows = [line.replace(",", " ").split() for line in Path(file).read_text().splitlines() if line[:1] not in ("", "#")]
numbers = np.array(rows, float)
if numbers.shape[1] == 12:
    if len(numbers) != len(times):
        sys.exit(f"{file}: {len(numbers)} matrices, and the drive has {len(times)} images: give a file with times")
    matrices = numbers.reshape(-1, 3, 4)
    where, rotations = matrices[:, :, 3], matrices[:, :, :3]
elif numbers.shape[1] in (8, 9):
    times = [row[0] for row in rows]
    where, (x, y, z, w) = numbers[:, 1:4], numbers[:, 4:8].T
    ahead = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w)], [2 * (x * z + y * w), 2 * (y * z - x * w)]
    rotations = np.zeros((len(rows), 3, 3))
    rotations[:, :2, 0], rotations[:, :2, 2] = np.transpose(ahead[0]), np.transpose(ahead[1])
else:
    sys.exit(f"{file}: lines of {numbers.shape[1]} numbers, expected 8 (TUM), 9 (RTAB-Map) or 12 (KITTI)")
forward = rotations[:, :2, 2 if axes else 0]
headings = np.arctan2(forward[:, 1], forward[:, 0])
lines = [f"{t},{x},{y},{h}" for t, (x, y), h in zip(times, where[:, :2], headings, strict=True)]
(FOLDER / "poses.csv").write_text("\n".join(["time,x,y,heading", *lines]) + "\n")
