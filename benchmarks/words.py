"""How near the image is that shares most visual words: the tables of docs/experiments/words.md.

    python benchmarks/words.py --data FOLDER
    python benchmarks/words.py --data FOLDER --filter   # variant=omniview_mcl candidates=words, two seeds

Metres between the most similar image of the map and the truth, median / mean / 90 %, every third image of the drive, in
the lights of `benchmarks/light.py`; and of how many images the most similar reference by colours at the best heading is
among so many with the most common words.
"""

import argparse
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
from light import LIGHTS, hsv, in_each_light, in_light, views
from variants import DataSet, data_sets

from omninav import Context
from omninav.stages.features.grey_world import grey_world_pixels
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.mapping.learned_words import LearnVisualWords, vocabulary_and_words
from omninav.stages.values.image import Panorama, Pixels

Array = npt.NDArray[np.float64]
CONTRAST, AMONG, POWER = 0.02, 50, 0.25
SIZES = (1024, 2048, 4096)


def grey(pixels: Pixels) -> Any:
    """omniview_mcl's features under a grey world."""
    return hsv(grey_world_pixels(pixels, 0.25))


def descriptors(images: list[Pixels]) -> list[npt.NDArray[np.uint8]]:
    """SIFT of panoramas, as candidates=words finds it."""
    stage, ctx = RotationReducedSift(contrast=CONTRAST), Context("local_features")
    stage.setup(ctx)
    return [stage.step(ctx, image=Panorama(pixels)).features.descriptors for pixels in images]


def by_colours(references: Any, described: list[Any]) -> Array:
    """Selective similarity of every image (N) to every reference (R) at its best heading."""
    return np.stack([similarities(references, view, 36, True, True, 0.5).max(axis=1) for view in described])


def errors(similar: Array, places: Array, truth: Array) -> str:
    """How far from the truth the most similar reference was taken."""
    off = np.hypot(*(places[similar.argmax(axis=1)] - truth)[:, :2].T)
    return f"{np.median(off):.2f} / {off.mean():.2f} / {np.quantile(off, 0.9):.2f}"


def measured(on: DataSet, sizes: tuple[int, ...]) -> None:
    """Print the rows of a recording."""
    (mapped, places), (seen, truth) = views(on.tour), views(on.drive)
    seen, truth = seen[::3], truth[::3]
    lit = {name: [in_light(pixels, light) for pixels in seen] for name, light in LIGHTS.items()}
    rows: dict[str, dict[str, Array]] = {}
    for name, described in {"colours, selective": hsv, "the same under a grey world": grey}.items():
        references = np.stack([described(pixels) for pixels in mapped])
        rows[name] = {
            light: by_colours(references, [described(pixels) for pixels in images]) for light, images in lit.items()
        }
    own, asked = descriptors(mapped), {light: descriptors(images) for light, images in lit.items()}
    for size in sizes:
        begun = time.process_time()
        words = vocabulary_and_words(own, size, LearnVisualWords.descriptors_per_word)
        taken = time.process_time() - begun
        rows[f"{size} words"] = {
            light: np.stack([words.similarities(view) for view in found]).astype(np.float64)
            for light, found in asked.items()
        }
        begun = time.process_time()
        for view in asked["as is"]:
            words.similarities(view)
        each = 1e3 * (time.process_time() - begun) / len(seen)
        print(f"    {on.name}, {size} words: learned in {taken:.1f} s CPU, an image asked in {each:.1f} ms", flush=True)
    by_words, colours = rows[f"{LearnVisualWords.words} words"], rows["the same under a grey world"]
    rows[f"grey world among {AMONG} by words"] = {
        light: np.where((-by_words[light]).argsort(axis=1).argsort(axis=1) < AMONG, each, 0.0)
        for light, each in colours.items()
    }
    rows[f"grey world times words^{POWER}"] = {
        light: each * by_words[light] ** POWER for light, each in colours.items()
    }
    for name, by_light in rows.items():
        print(f"| {on.name} | {name} | {' | '.join(errors(s, places, truth) for s in by_light.values())} |", flush=True)


def filtered(on: DataSet, power: float) -> None:
    """Print a row: the filter with words under a grey world, started anywhere."""
    changed = ["wires.features.panorama=perturbation.panorama", "wires.local_features.image=perturbation.panorama"]
    given = [
        "candidates=words",
        f"nodes.match.word_power={power}",
        "nodes.features.grey_world=local",
        "+wires.perturbation={panorama: unwarp.panorama}",
        *changed,
    ]
    print(f"| {on.name} | grey world times words^{power} | {' | '.join(in_each_light(on, given))} |", flush=True)


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--filter", action="store_true", help="the filter instead of the nearest image")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    print(f"| recording | compared by | {' | '.join(LIGHTS)} |\n|---|---|{'---|' * len(LIGHTS)}")
    for on in data_sets(given.data):
        if given.filter:
            for power in (0.05, POWER):
                filtered(on, power)
        else:
            measured(on, SIZES)


if __name__ == "__main__":
    main()
