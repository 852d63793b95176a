"""Renders the recordings of this folder anew, some 2.7 MB: python tests/data/make.py

A small home store, seen by a mirror camera of 280 x 210 pixels: `tour.mcap`, a day later `drive.mcap`, their
`camera.yaml`, the store's occupancy grid, and `images`, the drive's first half as a folder of panoramas with a CSV of
poses. The same source code gives the same files.
"""

import csv
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from omninav.stages.recordings.opening import open_recording

HERE = Path(__file__).resolve().parent
RATES = ("world.timing.images=1", "world.timing.odometry=10", "world.ranges.rate=1", "world.sensor.noise=1")
MIRROR = (
    "world_camera=mirror",
    "world.camera.image={width: 280, height: 210}",
    "world.camera.K=[[217.4375,0,139.5],[0,217.4375,104.5],[0,0,1]]",
    "world.camera.mask={inner_radius_px: 15, outer_radius_px: 104}",
)
STRIP = ("world_camera=cylinder", "world.camera.image={width: 240, height: 60}", "world.camera.column_of_forward=120")
FOLDER_IMAGES = 26
LAYOUT = """\
# Panoramas of a simulated drive with a CSV of their times and poses.  omninav log=FOLDER
frames:
  csv: frames.csv
  file: file
  time: {column: "time [ms]", unit: ms}
positions:
  x: {column: "x [cm]", unit: cm}
  y: {column: "y [cm]", unit: cm}
heading: {column: "heading [deg]", unit: deg}
camera: {projection: cylindrical, column_of_forward: 120, sense: clockwise, elevation: {top: 0.6, bottom: -0.8}}
"""


def simulate(folder: Path, name: str, *words: str) -> Path:
    """A log of the route of that name, with its camera and grid beside it."""
    command = [sys.executable, "-m", "omninav", "simulate", "world=home_store_demo", f"route={name}"]
    subprocess.run([*command, f"log={name}.mcap", *RATES, *words], cwd=folder, check=True)
    return folder / f"{name}.mcap"


def write_image_folder(log: Path, folder: Path) -> None:
    """The first images of a log as JPEG files with a CSV and a layout."""
    folder.mkdir()
    recording = open_recording(str(log))
    with (folder / "frames.csv").open("w", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["file", "time [ms]", "x [cm]", "y [cm]", "heading [deg]"])
        for number, stamp in enumerate(recording.stamps[:FOLDER_IMAGES]):
            name = f"{number:02}.jpg"
            cv2.imwrite(str(folder / name), recording.image(number), [cv2.IMWRITE_JPEG_QUALITY, 90])
            x, y, heading = recording.truth[number]
            rows.writerow([name, stamp // 10**6, f"{100 * x:.2f}", f"{100 * y:.2f}", f"{np.degrees(heading):.3f}"])
    (folder / "recording.yaml").write_text(LAYOUT)


def main() -> None:
    """Render everything elsewhere, then put it in place of what is here."""
    with tempfile.TemporaryDirectory() as scratch:
        made = Path(scratch)
        simulate(made, "tour", "day=0", *MIRROR)
        simulate(made, "drive", *MIRROR)
        (made / "strips").mkdir()
        write_image_folder(simulate(made / "strips", "drive", *STRIP), made / "images")
        for name, source in {
            "tour.mcap": "tour.mcap",
            "drive.mcap": "drive.mcap",
            "camera.yaml": "drive.camera.yaml",
            "map.yaml": "tour.grid/map.yaml",
            "map.pgm": "tour.grid/map.pgm",
            "images": "images",
        }.items():
            shutil.rmtree(HERE / name, ignore_errors=True)
            (HERE / name).unlink(missing_ok=True)
            shutil.move(made / source, HERE / name)


if __name__ == "__main__":
    main()
