"""Landmarks beside pycolmap 4.2 (`pip install pycolmap`).

`benchmarks/pycolmap_localiser.py TOUR DRIVE [dim warm side]`: both map the same images of the tour, and say where each
image of the drive was taken, as it is and in other light, on one core. `Pycolmap` is what its user writes; it sees
panoramas, for which it has a camera.
"""

import inspect
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

os.environ |= {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "NUMBA_NUM_THREADS": "1"}

import cv2
import numpy as np
import numpy.typing as npt
import pycolmap

import omninav
from omninav.pipeline import Context
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.mapping.learned_words import vocabulary_and_words
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording
from omninav.stages.sensor.landmark_pose import LandmarkPose
from omninav.stages.unwarp.table import remap_table

Array = npt.NDArray[np.float64]
Pixels = npt.NDArray[np.uint8]

UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From the robot's frame (forward, left, up) to a camera's that looks forward (right, down, forward)."""
COLUMNS, FEATURES = 1024, 2000
"""Size of a panorama, and the features of an image."""
NEIGHBOURS, CANDIDATES = 10, 10
"""Images that one of the map is matched with, and one of the drive."""
LIGHTS = {"as is": (1.0, 1.0, 1.0, 1.0, 0.0), "dim": (1.4, 0.35, 0.35, 0.35, 0.0), "warm": (1.0, 0.55, 1.0, 1.25, 0.0)}
LIGHTS["side"] = (1.0, 0.775, 0.775, 0.775, 0.677)
"""Exponent of the levels, gains of blue, green and red, and the share by which light from one side exceeds the mean."""


class Pycolmap:
    """A map of points with known poses, and the pose of an image in it."""

    def __init__(self, camera: Camera, folder: Path) -> None:
        self.folder, self.database, self.rad = folder, folder / "database.db", COLUMNS / (2.0 * math.pi)
        model = pycolmap.CameraModelId.EQUIRECTANGULAR
        self.camera = pycolmap.Camera.create_from_model_id(1, model, 0.0, COLUMNS, COLUMNS // 2)
        v, u = np.mgrid[0.5 : COLUMNS // 2, 0.5:COLUMNS]
        rays = self.camera.cam_ray_from_img(np.column_stack([u.ravel(), v.ravel()])) @ UPRIGHT
        self.table, seen = remap_table(camera, rays.reshape(*u.shape, 3))
        # no points at the rim of what the camera sees
        self.mask = cv2.erode(seen.reshape(u.shape).astype(np.uint8), np.ones((9, 9), np.uint8))
        options = pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False)
        options.sift.max_num_features = FEATURES
        self.sift = pycolmap.FeatureExtractor.create(options)
        self.matching = pycolmap.FeatureMatchingOptions(num_threads=1, use_gpu=False)
        self.matcher = pycolmap.FeatureMatcher.create(self.matching)

    def features(self, pixels: Pixels) -> tuple[Any, Any]:
        panorama = cv2.cvtColor(self.table.remap(pixels), cv2.COLOR_BGR2GRAY)
        keypoints, looks = self.sift.extract_from_uint8_array(panorama)
        rows = pycolmap.keypoints_to_matrix(keypoints)
        kept = np.flatnonzero(self.mask[rows[:, 1].astype(int), rows[:, 0].astype(int)])
        looks.data = looks.data[kept]
        return np.ascontiguousarray(rows[kept]), looks

    def learn(self, images: list[Pixels], poses: Array) -> None:
        (self.folder / "model").mkdir()
        found = [self.features(image) for image in images]
        known = pycolmap.Reconstruction()
        with pycolmap.Database.open(self.database) as database:
            self.camera.camera_id = database.write_camera(self.camera)
            rig = pycolmap.Rig()
            rig.add_ref_sensor(self.camera.sensor_id)
            rig.rig_id = database.write_rig(rig)
            known.add_camera(self.camera)
            known.add_rig(rig)
            for n, ((keypoints, looks), pose) in enumerate(zip(found, poses, strict=True), 1):
                rotation = UPRIGHT @ turned(pose[2]).T
                image = pycolmap.Image(name=f"{n:05d}.png", camera_id=self.camera.camera_id, image_id=n)
                frame = pycolmap.Frame(frame_id=n, rig_id=rig.rig_id)
                frame.add_data_id(image.data_id)
                image.frame_id = n
                database.write_frame(frame, use_frame_id=True)
                database.write_image(image, use_image_id=True)
                database.write_keypoints(n, keypoints[:, :2])
                database.write_descriptors(n, looks)
                centre = np.array([*pose[:2], 0.0])
                frame.rig_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ centre)
                known.add_frame(frame)
                known.add_image(image)
        pairs = [f"{a + 1:05d}.png {b + 1:05d}.png" for a, b in neighbours(poses)]
        (self.folder / "pairs.txt").write_text("\n".join(pairs))
        pairing = pycolmap.ImportedPairingOptions(match_list_path=self.folder / "pairs.txt")
        pycolmap.match_image_pairs(self.database, self.matching, pairing)
        options = pycolmap.IncrementalPipelineOptions(num_threads=1)
        map = pycolmap.triangulate_points(known, self.database, self.folder, self.folder / "model", options=options)
        self.references = []
        for n, (keypoints, looks) in enumerate(found, 1):
            rows = map.images[n].points2D
            kept = [row for row, point in enumerate(rows) if point.has_point3D()]
            looks.data = looks.data[kept]
            points = np.array([map.points3D[rows[row].point3D_id].xyz for row in kept]).reshape(-1, 3)
            self.references.append((pycolmap.keypoints_from_matrix(keypoints[kept]), looks, points))
        self.points = map.num_points3D()
        size = sum(file.stat().st_size for file in (self.folder / "model").iterdir())
        self.megabytes = (size + sum(looks.data.nbytes for _, looks, _ in self.references)) / 1e6
        # pycolmap 4.2.1 has an index of visual words, but its queries return nothing to Python.
        self.words = vocabulary_and_words([looks.data for _, looks, _ in self.references], 2048, 16)

    def locate(self, pixels: Pixels) -> Array | None:
        keypoints, looks = self.features(pixels)
        likely = np.argsort(-self.words.similarities(looks.data), kind="stable")[:CANDIDATES]
        seen, points = [np.empty((0, 2))], [np.empty((0, 3))]
        for theirs, other, there in (self.references[n] for n in likely):
            if len(keypoints) and len(there):
                pairs = self.matcher.match(pycolmap.keypoints_from_matrix(keypoints), looks, theirs, other)
                seen.append(keypoints[pairs[:, 0], :2])
                points.append(there[pairs[:, 1]])
        options = pycolmap.AbsolutePoseEstimationOptions()
        options.ransac.max_error = math.radians(0.6) * self.rad
        all_seen, all_points = np.concatenate(seen), np.concatenate(points)
        out = pycolmap.estimate_and_refine_absolute_pose(all_seen, all_points, self.camera, options)
        if out is None:
            return None
        rotation = out["cam_from_world"].rotation.matrix().T
        forward, centre = rotation @ UPRIGHT[:, 0], -rotation @ out["cam_from_world"].translation
        return np.array([*centre[:2], math.atan2(forward[1], forward[0])])


def turned(heading: float) -> Array:
    """Rotation (3, 3) by a heading (rad)."""
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def neighbours(poses: Array) -> list[tuple[int, int]]:
    """Pairs of images to match: each with the nearest ones that are 0.1 m away and more."""
    away = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).T)
    nearest = np.argsort(np.where(away > 0.1, away, np.inf), axis=1, kind="stable")[:, :NEIGHBOURS]
    return sorted({(min(a, b), max(a, b)) for a, row in enumerate(nearest.tolist()) for b in row})


def lit(recording: Recording, light: str) -> list[Pixels]:
    """All images of a recording in a light."""
    (gamma, *gains, side), camera = LIGHTS[light], recording.camera
    rays, _ = camera.unproject(camera.grid())
    around = 1.0 + side * np.nan_to_num(np.cos(np.arctan2(rays[..., 1], rays[..., 0])))[..., None]
    levels = ((recording.image(n) / 255.0) ** gamma * gains * around for n in range(len(recording.stamps)))
    return [np.clip(np.rint(255.0 * each), 0, 255).astype(np.uint8) for each in levels]


def say(who: str, light: str, found: list[Array | None], truth: Array, ms: float) -> None:
    """Print a row of the table."""
    away = np.array([[np.nan] * 3 if each is None else each for each in found]) - truth
    metres, degrees = np.hypot(away[:, 0], away[:, 1]), np.abs(np.degrees(wrap(away[:, 2])))
    right, none, errors = np.mean((metres < 0.25) & (degrees < 2.0)), np.mean(np.isnan(metres)), "– | –"
    if none < 1.0:
        m, deg = (np.nanquantile(each, (0.5, 0.9)) for each in (metres, degrees))
        errors = f"{m[0]:.4f} / {m[1]:.4f} | {deg[0]:.3f} / {deg[1]:.3f}"
    print(f"| {who} | {light} | {errors} | {right:.1%} | {none:.1%} | {ms:.0f} |", flush=True)


def with_omninav(tour: str, drive: Recording, lights: list[str], folder: Path) -> Any:
    """Print what omninav does; gives its map."""
    command = [str(Path(sys.executable).with_name("omninav")), "map", f"log={tour}", f"runs={folder}", "cache=null"]
    subprocess.run([*command, "plots=none"], check=True, capture_output=True)
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    (file,) = folder.glob("2*/map.omap")
    map, alone = omninav.load_map(file), LandmarkPose()
    size = file.stat().st_size / 1e6
    print(f"omninav's map: {used.ru_utime + used.ru_stime:.0f} s, {size:.1f} MB, {len(map.landmarks)} points, 2 lines")
    (folder / "camera.yaml").write_text(write_camera(drive.camera))
    settings: dict[str, Any] = {"map": file, "camera": folder / "camera.yaml", "cache": None, "plots": "none"}
    for light in lights:
        images, fixes, estimates, ms = lit(drive, light), [], [], 0.0
        with omninav.open(folder=folder / light, **settings) as session:
            for n, image in enumerate(images):
                began = time.process_time()
                out = session.step(image=image, odometry=None if drive.odometry is None else drive.odometry[n])
                ms += 1000.0 * (time.process_time() - began) / len(images)
                fix, pose = alone.step(Context("alone"), out["points.features"], map).fix, out.estimate.pose
                fixes.append(None if fix is None else fix.poses[0])
                estimates.append(np.array([pose.x, pose.y, pose.heading]))
        say("omninav, each image by itself", light, fixes, drive.truth, math.nan)
        if drive.odometry is not None:
            say("omninav", light, estimates, drive.truth, ms)
    return map


def main() -> None:
    """Both, one after the other, of the same images of the tour."""
    lights = ["as is", *sys.argv[3:]]
    cv2.setNumThreads(1)
    tour, drive = open_recording(sys.argv[1]), open_recording(sys.argv[2])
    print("| | light | error (m) | error (deg) | in (0.25 m, 2°) | no pose | ms an image |")
    with tempfile.TemporaryDirectory() as place:
        map = with_omninav(sys.argv[1], drive, lights, Path(place))
        rows = [int(np.hypot(*(tour.truth[:, :2] - pose[:2]).T).argmin()) for pose in map.poses]
        began = time.process_time()
        theirs = Pycolmap(tour.camera, Path(place))
        theirs.learn([tour.image(row) for row in rows], tour.truth[rows])
        seconds, lines = time.process_time() - began, len(inspect.getsource(Pycolmap).splitlines())
        print(f"pycolmap's map: {seconds:.0f} s, {theirs.megabytes:.1f} MB, {theirs.points} points, {lines} lines")
        for light in lights:
            images, began = lit(drive, light), time.process_time()
            found = [theirs.locate(image) for image in images]
            ms = 1000.0 * (time.process_time() - began) / len(images)
            say("pycolmap, each image by itself", light, found, drive.truth, ms)


if __name__ == "__main__":
    main()
