"""Structure from motion with known poses and the pose of an image from its points, hloc's way: `pip install pycolmap`.

omninav variant=peer command="python benchmarks/peers/sfm_and_pnp.py" tour=tour.mcap log=drive.mcap

It sees panoramas, for which pycolmap has a camera. Images of the map are taken where the robot moved or turned on. A
folder as a second word keeps maps: `python benchmarks/peers/sfm_and_pnp.py maps`.
"""

import hashlib
import math
import os
import shutil
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
from given import FOLDER, localise, the_map

from omninav.stages.mapping.learned_words import vocabulary_and_words
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.unwarp.table import remap_table

try:
    import pycolmap
except ImportError:
    sys.exit("pycolmap is not installed: pip install pycolmap")

UPRIGHT = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
"""From the robot's frame (forward, left, up) to a camera's that looks forward (right, down, forward)."""
COLUMNS, FEATURES = 1024, 2000
"""Size of a panorama, and the features of an image."""
NEIGHBOURS, CANDIDATES = 10, 10
"""Images that one of the map is matched with, and one of the drive."""
APART_M, APART_RAD = 0.2, 0.35
"""An image of the map is taken where the robot is this far from the last, or has turned by this."""

KIND = pycolmap.FeatureExtractorType.SIFT

place = tempfile.TemporaryDirectory()
work = Path(place.name)
camera = pycolmap.Camera.create_from_model_id(1, pycolmap.CameraModelId.EQUIRECTANGULAR, 0.0, COLUMNS, COLUMNS // 2)
v, u = np.mgrid[0.5 : COLUMNS // 2, 0.5:COLUMNS]
rays = camera.cam_ray_from_img(np.column_stack([u.ravel(), v.ravel()])) @ UPRIGHT
table, seen = remap_table(read_camera(FOLDER / "camera.yaml"), rays.reshape(*u.shape, 3))
mask = cv2.erode(seen.reshape(u.shape).astype(np.uint8), np.ones((9, 9), np.uint8))  # no points at the rim
options = pycolmap.FeatureExtractionOptions(num_threads=1, use_gpu=False)
options.sift.max_num_features = FEATURES
sift = pycolmap.FeatureExtractor.create(options)
matching = pycolmap.FeatureMatchingOptions(num_threads=1, use_gpu=False)
matcher = pycolmap.FeatureMatcher.create(matching)


def features(file):
    panorama = cv2.cvtColor(table.remap(cv2.imread(str(file))), cv2.COLOR_BGR2GRAY)
    keypoints, looks = sift.extract_from_uint8_array(panorama)
    rows = pycolmap.keypoints_to_matrix(keypoints)
    kept = np.flatnonzero(mask[rows[:, 1].astype(int), rows[:, 0].astype(int)])
    looks.data = looks.data[kept]
    return np.ascontiguousarray(rows[kept]), looks


def spaced(poses):
    taken = [0]
    for row, (x, y, heading) in enumerate(poses):
        last = poses[taken[-1]]
        turn = abs(math.remainder(heading - last[2], 2 * math.pi))
        if math.hypot(x - last[0], y - last[1]) >= APART_M or turn >= APART_RAD:
            taken.append(row)
    return taken


def neighbours(poses):
    away = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).T)
    nearest = np.argsort(np.where(away > 0.1, away, np.inf), axis=1, kind="stable")[:, :NEIGHBOURS]
    return sorted({(min(a, b), max(a, b)) for a, row in enumerate(nearest.tolist()) for b in row})


def triangulated(found, poses):
    """Points of the map, and which of each image's features they are."""
    known = pycolmap.Reconstruction()
    with pycolmap.Database.open(work / "database.db") as database:
        camera.camera_id = database.write_camera(camera)
        rig = pycolmap.Rig()
        rig.add_ref_sensor(camera.sensor_id)
        rig.rig_id = database.write_rig(rig)
        known.add_camera(camera)
        known.add_rig(rig)
        for n, ((keypoints, looks), (x, y, heading)) in enumerate(zip(found, poses, strict=True), 1):
            cos, sin = math.cos(heading), math.sin(heading)
            rotation = UPRIGHT @ np.array([[cos, sin, 0.0], [-sin, cos, 0.0], [0.0, 0.0, 1.0]])
            image = pycolmap.Image(name=f"{n:05d}.png", camera_id=camera.camera_id, image_id=n)
            frame = pycolmap.Frame(frame_id=n, rig_id=rig.rig_id)
            frame.add_data_id(image.data_id)
            image.frame_id = n
            database.write_frame(frame, use_frame_id=True)
            database.write_image(image, use_image_id=True)
            database.write_keypoints(n, keypoints[:, :2])
            database.write_descriptors(n, looks)
            frame.rig_from_world = pycolmap.Rigid3d(pycolmap.Rotation3d(rotation), -rotation @ (x, y, 0.0))
            known.add_frame(frame)
            known.add_image(image)
    pairs = [f"{a + 1:05d}.png {b + 1:05d}.png" for a, b in neighbours(poses)]
    (work / "pairs.txt").write_text("\n".join(pairs))
    pairing = pycolmap.ImportedPairingOptions(match_list_path=work / "pairs.txt")
    pycolmap.match_image_pairs(work / "database.db", matching, pairing)
    (work / "model").mkdir()
    once = pycolmap.IncrementalPipelineOptions(num_threads=1)
    return pycolmap.triangulate_points(known, work / "database.db", work, work / "model", options=once)


def mapped():
    """The features of each image that are points of the map, and these points: keypoints, looks, points, ends."""
    files, poses = the_map()
    rows = spaced(poses)
    found = [features(files[row]) for row in rows]
    map, parts = triangulated(found, poses[rows]), []
    for n, (keypoints, looks) in enumerate(found, 1):
        points = map.images[n].points2D
        kept = [row for row, point in enumerate(points) if point.has_point3D()]
        there = np.array([map.points3D[points[row].point3D_id].xyz for row in kept]).reshape(-1, 3)
        parts.append((keypoints[kept], looks.data[kept], there))
    ends = np.cumsum([len(there) for _, _, there in parts])[:-1]
    return [*(np.concatenate(part) for part in zip(*parts, strict=True)), ends]


FILE = FOLDER / "map.npz"
if len(sys.argv) > 2:  # a folder, in which later calls find the maps of earlier ones
    digest = hashlib.sha256()
    for file in [FOLDER / "camera.yaml", *sorted((FOLDER / "map").iterdir())]:
        digest.update(file.read_bytes())
    known = Path(sys.argv[1]) / f"{digest.hexdigest()[:16]}.npz"
    known.parent.mkdir(exist_ok=True)
    if known.exists():
        shutil.copy(known, FILE)
if not FILE.exists():
    np.savez(FILE, *mapped())
    if len(sys.argv) > 2:
        shutil.copy(FILE, part := known.with_suffix(f".{os.getpid()}.part"))
        part.replace(known)
*parts, ends = np.load(FILE).values()
references = [
    (pycolmap.keypoints_from_matrix(keypoints), pycolmap.FeatureDescriptors(KIND, looks), points)
    for keypoints, looks, points in zip(*(np.split(part, ends) for part in parts), strict=True)
]
# pycolmap 4.2.1 has an index of visual words, but its queries return nothing to Python.
words = vocabulary_and_words([looks.data for _, looks, _ in references], 2048)
place.cleanup()


def pose_of(file, motion):
    keypoints, looks = features(file)
    likely = np.argsort(-words.similarities(looks.data), kind="stable")[:CANDIDATES]
    here, points = [np.empty((0, 2))], [np.empty((0, 3))]
    for theirs, other, there in (references[n] for n in likely):
        if len(keypoints) and len(there):
            pairs = matcher.match(pycolmap.keypoints_from_matrix(keypoints), looks, theirs, other)
            here.append(keypoints[pairs[:, 0], :2])
            points.append(there[pairs[:, 1]])
    options = pycolmap.AbsolutePoseEstimationOptions()
    options.ransac.max_error = math.radians(0.6) * COLUMNS / (2.0 * math.pi)
    out = pycolmap.estimate_and_refine_absolute_pose(np.concatenate(here), np.concatenate(points), camera, options)
    if out is None:
        return None
    rotation = out["cam_from_world"].rotation.matrix().T
    forward, centre = rotation @ UPRIGHT[:, 0], -rotation @ out["cam_from_world"].translation
    return (*centre[:2], math.atan2(forward[1], forward[0]))


localise(pose_of)
