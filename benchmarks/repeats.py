"""How far apart two drives along one route lie: those of a robot and of an ant walked twice, and simulated ones.

python benchmarks/repeats.py FOLDER, with the folders sussex-outdoor-route and antworld-rendered in it.
The drives' positions come every few centimetres; the tracker's noise of Sussex (1.5 cm) is taken off by a mean over one
second.
"""

import sys
from pathlib import Path

import numpy as np
import numpy.typing as npt

from omninav.stages.simulator import route_planning
from omninav.stages.simulator.config import Robot, WorldConfig
from omninav.stages.simulator.robot import drive
from omninav.stages.simulator.world import World

F64 = npt.NDArray[np.float64]
STEP_M = 0.05
SMOOTHED = 31
"""Positions, at 30 a second."""


def evenly(line: F64) -> F64:
    """Points (N, 2) every 5 cm along a line."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(line, axis=0).T))])
    at = np.arange(0.0, along[-1], STEP_M)
    return np.stack([np.interp(at, along, line[:, axis]) for axis in range(2)], axis=1)


def smooth(line: F64) -> F64:
    """The mean of each position and its neighbours within half a second."""
    padded = np.pad(line, ((SMOOTHED // 2, SMOOTHED // 2), (0, 0)), mode="edge")
    kernel = np.full(SMOOTHED, 1.0 / SMOOTHED)
    return np.stack([np.convolve(padded[:, axis], kernel, "valid") for axis in range(2)], axis=1)


def lateral(one: F64, other: F64) -> F64:
    """Signed distance (m, left is positive) of the points of a line from another one; not beyond its ends."""
    starts, legs = one[:-1], np.diff(one, axis=0)
    distances = []
    for point in other:
        share = np.clip(((point - starts) * legs).sum(axis=1) / (legs**2).sum(axis=1), 0.0, 1.0)
        aside = point - starts - share[:, None] * legs
        leg = int(np.argmin((aside**2).sum(axis=1)))
        if (leg, share[leg]) not in ((0, 0.0), (len(legs) - 1, 1.0)):
            left = np.sign(legs[leg, 0] * aside[leg, 1] - legs[leg, 1] * aside[leg, 0])
            distances.append(left * np.hypot(*aside[leg]))
    return np.array(distances)


def show(name: str, one: F64, other: F64) -> None:
    """Print how far apart two drives are, and over which way they stay so."""
    one, other = evenly(one), evenly(other)
    off = lateral(one, other)
    lags = np.arange(len(off) // 2)
    related = np.array([np.mean(off[: len(off) - lag] * off[lag:]) for lag in lags]) / np.mean(off**2)
    half = STEP_M * int(np.argmax(related < 0.5))
    print(
        f"{name}: {STEP_M * len(one):.1f} m, root mean square {np.sqrt(np.mean(off**2)):.2f} m, "
        f"90 % below {np.quantile(np.abs(off), 0.9):.2f} m, half of it related over {half:.1f} m"
    )


def main() -> None:
    """Print a line for each pair of drives."""
    sussex, antworld = (
        Path(sys.argv[1]) / name for name in ("sussex-outdoor-route/tracking_data", "antworld-rendered")
    )
    files = [sussex / f"{name}_scaled.csv" for name in ("training_path", "testing_path_infomax_binary")]
    show("Sussex, training and repeat", *(smooth(np.loadtxt(file, delimiter=",")[:, 1:] / 100.0) for file in files))
    walks = [antworld / name / f"{name}.csv" for name in ("ant1_route1", "ant1_route2")]
    rows = [np.loadtxt(walk, delimiter=",", skiprows=1, usecols=(0, 1)) / 1000.0 for walk in walks]
    show("AntWorld, two walks", *rows)
    hall, line = World(WorldConfig(size=(510.0, 30.0))), np.array([[5.0, 15.0], [505.0, 15.0]])
    for jitter in (0.04, 0.2, 0.4):
        lines = [route_planning.jittered(hall, line, jitter, np.random.default_rng(day)) for day in (1, 2)]
        show(f"simulated, path_jitter_m={jitter}", *(drive(each, Robot(), 20.0).poses[:, :2] for each in lines))


if __name__ == "__main__":
    main()
