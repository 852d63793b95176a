"""A particle filter: small colour panoramas of the nearest image of the map, odometry (OpenCV and numpy).

omninav variant=peer command="python benchmarks/peers/particle_filter.py" tour=tour.mcap log=drive.mcap
"""

import numpy as np
from given import FOLDER, localise, similarities, small_panoramas, the_map

NUMBER, NEW = 4000, 0.05
"""Particles, and the share of them that begins anew at the most similar images."""
SHARPNESS, REACH_M, MODE_M = 40.0, 0.5, 0.5
"""Exponent of the likelihood exp(sharpness * correlation), its range about an image, and the radius of a mode."""

rng = np.random.default_rng(0)
files, poses = the_map()
small = small_panoramas(columns=72, rows=12)
spectra = np.fft.rfft([small(file) for file in files], axis=2)
np.save(FOLDER / "map.npy", spectra.astype(np.complex64))
particles = poses[rng.integers(len(poses), size=NUMBER)] + rng.normal(size=(NUMBER, 3)) * (0.3, 0.3, 0.2)
particles[:, 2] += rng.uniform(0, 2 * np.pi, NUMBER)


def pose_of(file, motion):
    global particles
    found = similarities(spectra, small(file))
    forward, left, turn = np.nan_to_num(motion)
    cos, sin = np.cos(particles[:, 2]), np.sin(particles[:, 2])
    particles += np.column_stack([cos * forward - sin * left, sin * forward + cos * left, np.full(NUMBER, turn)])
    noise = 0.02 + 0.1 * np.hypot(forward, left), 0.02 + 0.1 * np.hypot(forward, left), 0.02 + 0.1 * abs(turn)
    particles += rng.normal(size=particles.shape) * noise
    chance = np.exp(SHARPNESS * (found.max(axis=1) - found.max()))
    drawn = rng.choice(len(poses), int(NEW * NUMBER), p=chance / chance.sum())
    turns = -2 * np.pi * found[drawn].argmax(axis=1) / found.shape[1]
    anew = poses[drawn] + np.column_stack([rng.normal(size=(len(drawn), 2)) * 0.1, turns])
    particles[: len(drawn)] = anew  # resampling has left them in no order that matters
    squares = ((particles[:, None, :2] - poses[None, :, :2]) ** 2).sum(axis=2)
    near, away = squares.argmin(axis=1), squares.min(axis=1)
    column = np.round((poses[near, 2] - particles[:, 2]) / (2 * np.pi) * found.shape[1]).astype(int) % found.shape[1]
    weights = np.exp(SHARPNESS * (found[near, column] - found.max()) - 0.5 * away / REACH_M**2)
    weights /= weights.sum()
    places = (rng.random() + np.arange(NUMBER)) / NUMBER
    particles = particles[np.searchsorted(weights.cumsum(), places).clip(0, NUMBER - 1)]
    rng.shuffle(particles)
    close = ((particles[:50, None, :2] - particles[None, :, :2]) ** 2).sum(axis=2) < MODE_M**2
    mode = particles[close[close.sum(axis=1).argmax()]]
    return (*mode[:, :2].mean(axis=0), np.angle(np.exp(1j * mode[:, 2]).sum()))


localise(pose_of)
