"""omninav itself, as a program that is given the same folder; words of the command line are its settings.

omninav variant=peer command="python benchmarks/peers/ours.py variant=omninav" tour=tour.mcap log=drive.mcap
"""

import shutil
import sys
import tempfile
import warnings
from pathlib import Path

import cv2
import numpy as np
from given import FOLDER, localise

import omninav

DESCRIPTION = """
folder: .
frames: {csv: images.csv, file: file, time: {column: time, unit: s}}
positions: {x: {column: x, unit: m}, y: {column: y, unit: m}}
heading: {column: heading, unit: rad}
"""
warnings.simplefilter("ignore")
(FOLDER / "map" / "map.yaml").write_text(DESCRIPTION)
settings = {"tour": FOLDER / "map" / "map.yaml", "camera": FOLDER / "camera.yaml", "cache": None, "plots": "none"}
run = Path(tempfile.mkdtemp(dir=FOLDER))
with omninav.open(*sys.argv[1:-1], folder=run / "run", **settings) as session:
    odometry = np.zeros(3)

    def pose_of(file, motion):
        x, y, turn = np.nan_to_num(motion)
        cos, sin = np.cos(odometry[2]), np.sin(odometry[2])
        odometry[:] += (cos * x - sin * y, sin * x + cos * y, turn)
        pose = session.step(image=cv2.imread(str(file)), odometry=odometry.copy()).estimate.pose
        return pose.x, pose.y, pose.heading

    localise(pose_of)
shutil.move(run / "run" / "map.omap", FOLDER / "map.omap")
shutil.rmtree(run)
