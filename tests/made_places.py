"""A small topological map for tests: places on given spots, joined by given links, with one made-up feature a view."""

from collections.abc import Mapping, Sequence

import numpy as np
from made_words import features_of

from omninav.stages.values.local_features import GlobalDescriptor
from omninav.stages.values.topological_map import DRIVEN, LOOP, TopologicalMap, stored


def made_map(
    spots: Sequence[tuple[float, float]],
    between: Mapping[tuple[int, int], int],
    loops: Sequence[tuple[int, int]] = (),
    names: Sequence[str] = (),
) -> TopologicalMap:
    """Places on `spots` (m). `between`: path images from the first to the second place of each link that was driven."""
    ways, owner = [], list(range(len(spots)))
    for (one, _), number in between.items():
        ways.append(list(range(len(owner), len(owner) + number)))
        owner += [one] * number
    ways += [[] for _ in loops]
    rng = np.random.default_rng(0)
    features = [features_of(rng.integers(0, 255, (1, 128)).astype(np.uint8)) for _ in owner]
    poses = np.zeros((len(owner), 3))
    poses[:, :2] = np.array(spots)[owner]
    return TopologicalMap(
        views=stored(features, [GlobalDescriptor(np.zeros(3, np.float32))] * len(owner)),
        places=np.arange(len(spots)),
        owner=np.array(owner),
        names=tuple(names) or ("",) * len(spots),
        links=np.array([*between, *loops], np.int64).reshape(-1, 2),
        kinds=np.array([DRIVEN] * len(between) + [LOOP] * len(loops), np.int8),
        way_starts=np.cumsum([0, *(len(way) for way in ways)]),
        ways=np.array([view for way in ways for view in way], np.int64),
        frames=np.arange(len(owner)) * 10,
        orders=np.arange(len(owner)),
        poses=poses,
        pose_source="truth",
        spread=1.0,
    )
