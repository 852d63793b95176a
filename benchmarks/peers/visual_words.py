"""Visual words, and the ten most similar images ranked anew by a planar essential matrix (OpenCV and numpy).

omninav variant=peer command="python benchmarks/peers/visual_words.py" tour=tour.mcap log=drive.mcap
"""

import cv2
import numpy as np
from given import FOLDER, localise, the_map

WORDS, CANDIDATES, FEATURES = 1000, 10, 500
DRAWS, INLIER, ENOUGH = 300, 0.01, 12
"""RANSAC's draws, largest residual (some radians), and least number of matches that make a pose."""

rng = np.random.default_rng(0)
cv2.setRNGSeed(0)
rays = np.load(FOLDER / "rays.npy")
sift = cv2.SIFT_create(FEATURES)
matcher = cv2.BFMatcher()


def features(file):
    found, looks = sift.detectAndCompute(cv2.imread(str(file), cv2.IMREAD_GRAYSCALE), None)
    bearings = np.array([rays[int(point.pt[1]), int(point.pt[0])] for point in found]).reshape(-1, 3)
    seen = np.isfinite(bearings[:, 0])
    return bearings[seen], looks[seen] if len(found) else np.empty((0, 128), np.float32)


def histogram(looks):
    if not len(looks):
        return np.zeros(len(words))
    return np.bincount([match.trainIdx for match in matcher.match(looks, words)], minlength=len(words)).astype(float)


files, poses = the_map()
references = [features(file) for file in files]
every = np.concatenate([looks for _, looks in references])
some = every[rng.permutation(len(every))[:50_000]]
stop = (cv2.TERM_CRITERIA_MAX_ITER, 10, 0.0)
_, _, words = cv2.kmeans(some, min(WORDS, len(some)), None, stop, 1, cv2.KMEANS_RANDOM_CENTERS)
counts = np.array([histogram(looks) for _, looks in references])
rarity = np.log(len(counts) / np.maximum((counts > 0).sum(axis=0), 1))
index = counts * rarity
index /= np.maximum(np.linalg.norm(index, axis=1, keepdims=True), 1e-9)
np.savez(
    FOLDER / "map.npz",
    index=index.astype(np.float32),
    words=words,
    looks=every.astype(np.uint8),
    bearings=np.concatenate([bearings for bearings, _ in references]).astype(np.float32),
)


def turn_between(there, here):
    """Matches that one turn about the vertical and one direction explain, and that turn (rad)."""
    rows = np.column_stack([here[:, :2] * there[:, 2:], there[:, :2] * here[:, 2:]])
    drawn = rows[rng.integers(len(rows), size=(DRAWS, 3))]
    models = np.linalg.svd(drawn, full_matrices=True)[2][:, 3]
    inliers = (np.abs(rows @ models.T) < INLIER * np.linalg.norm(models[:, :2], axis=1)).sum(axis=0)
    ty, tx, c, d = models[inliers.argmax()] * (1, -1, 1, 1)
    return inliers.max(), np.arctan2(tx * c + ty * d, tx * d - ty * c)


def pose_of(file, motion):
    bearings, looks = features(file)
    best, pose = ENOUGH - 1, None
    for row in np.argsort(-(index @ (histogram(looks) * rarity)))[:CANDIDATES]:
        there, known = references[row]
        pairs = matcher.knnMatch(looks, known, 2) if len(looks) and len(known) > 1 else []
        pairs = [one for one, two in pairs if one.distance < 0.8 * two.distance]
        if len(pairs) < ENOUGH:
            continue
        number, turn = turn_between(there[[p.trainIdx for p in pairs]], bearings[[p.queryIdx for p in pairs]])
        if number > best:
            best, pose = number, (*poses[row, :2], poses[row, 2] - turn)
    return pose


localise(pose_of)
