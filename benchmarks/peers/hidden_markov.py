"""A hidden Markov model whose states are the map's images: small colour panoramas, odometry (OpenCV and numpy).

omninav variant=peer command="python benchmarks/peers/hidden_markov.py" tour=tour.mcap log=drive.mcap
"""

import numpy as np
from given import FOLDER, localise, similarities, small_panoramas, the_map

SHARPNESS = 40.0
"""Exponent of the likelihood exp(sharpness * correlation)."""
SLACK_M, LOST = 0.15, 1e-4
"""Standard deviation of a step about the odometry's, and the probability of a step to anywhere."""

files, poses = the_map()
small = small_panoramas(columns=72, rows=12)
spectra = np.fft.rfft([small(file) for file in files], axis=2)
np.save(FOLDER / "map.npy", spectra.astype(np.complex64))
distances = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).T)
belief = np.full(len(poses), 1.0 / len(poses))


def pose_of(file, motion):
    global belief
    moved = np.hypot(*np.nan_to_num(motion[:2]))
    step = np.exp(-0.5 * ((distances - moved) / (SLACK_M + 0.2 * moved)) ** 2)
    belief = (step / step.sum(axis=0)) @ belief + LOST
    found = similarities(spectra, small(file))
    belief *= np.exp(SHARPNESS * (found.max(axis=1) - found.max()))
    belief /= belief.sum()
    best = belief.argmax()
    return (*poses[best, :2], poses[best, 2] - 2 * np.pi * found[best].argmax() / found.shape[1])


localise(pose_of)
