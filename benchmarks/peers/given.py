"""Reads what a localiser is given, and writes the poses it leaves, for the adapters of this folder (docs/peers.md)."""

import csv
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np

FOLDER = Path(sys.argv[-1])


def images(which: str, *columns: str) -> tuple[list[Path], list[str], Any]:
    """Files, times and three numbers each of the `map` or of the `drive`."""
    with (FOLDER / which / "images.csv").open() as file:
        rows = list(csv.DictReader(file))
    numbers = [[float(row[name] or "nan") for name in columns] for row in rows]
    return [FOLDER / which / row["file"] for row in rows], [row["time"] for row in rows], np.array(numbers)


def the_map() -> tuple[list[Path], Any]:
    """Files and poses (x, y, heading)."""
    files, _, poses = images("map", "x", "y", "heading")
    return files, poses


def localise(pose_of: Callable[[Path, Any], Any]) -> None:
    """Write the pose that `pose_of` gives for each image of the drive and its motion since the last; None: none."""
    files, times, odometry = images("drive", "odometry_x", "odometry_y", "odometry_heading")
    lines, last = ["time,x,y,heading,cpu_ms"], None
    for file, stamp, here in zip(files, times, odometry, strict=True):
        began = time.process_time()
        pose = pose_of(file, np.zeros(3) if last is None else between(last, here))
        took, last = 1000.0 * (time.process_time() - began), here
        numbers = ("", "", "") if pose is None else (*pose[:2], (pose[2] + np.pi) % (2 * np.pi) - np.pi)
        lines.append(",".join([stamp, *map(str, numbers), str(took)]))
    (FOLDER / "poses.csv").write_text("\n".join(lines) + "\n")


def between(a: Any, b: Any) -> Any:
    """The motion from one pose to another, in the frame of the first: x forward, y left, turn."""
    away, turn = (b - a)[:2], (b - a)[2]
    cos, sin = np.cos(a[2]), np.sin(a[2])
    forward, left = cos * away[0] + sin * away[1], cos * away[1] - sin * away[0]
    return np.array([forward, left, (turn + np.pi) % (2 * np.pi) - np.pi])


def small_panoramas(columns: int, rows: int) -> Callable[[Path], Any]:
    """A function that gives an image as a small panorama (rows, columns, 3), with a mean of 0 and a length of 1."""
    rays = np.load(FOLDER / "rays.npy")
    seen = np.isfinite(rays[..., 0])
    azimuth, elevation = np.arctan2(rays[seen][:, 1], rays[seen][:, 0]), np.arcsin(rays[seen][:, 2])
    column = np.floor((azimuth / (2 * np.pi)) % 1 * columns).astype(int) % columns
    low, high = elevation.min(), elevation.max() + 1e-6
    cell = np.floor((elevation - low) / (high - low) * rows).astype(int) * columns + column
    number = np.maximum(np.bincount(cell, minlength=rows * columns), 1)

    def small(file: Path) -> Any:
        pixels = cv2.imread(str(file))[seen].astype(float)
        means = [np.bincount(cell, pixels[:, channel], rows * columns) / number for channel in range(3)]
        view = np.stack(means, axis=-1).reshape(rows, columns, 3)
        view -= view.mean(axis=(0, 1))
        return view / (np.linalg.norm(view) or 1.0)

    return small


def similarities(spectra: Any, view: Any) -> Any:
    """Correlation of a view with views whose `spectra` along columns are given, at every turn: (views, columns)."""
    products = np.conj(spectra) * np.fft.rfft(view, axis=1)
    return np.fft.irfft(products.sum(axis=(1, 3)), view.shape[1], axis=1)
