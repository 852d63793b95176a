"""How far changed light takes the estimate from the truth, on recordings: the tables of docs/experiments/light.md.

    python benchmarks/light.py --data FOLDER            # the nearest image of the map alone, every third image
    python benchmarks/light.py --data FOLDER --filter   # variant=omniview_mcl from a start anywhere, two seeds

Errors in metres: median / mean / 90 % of the nearest image; median / 90 % (share lost) of the filter once converged.
"""

import argparse
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from variants import LIGHTS, DataSet, data_sets

import omninav
from omninav import Context
from omninav.stages.features.colour_histogram import colour_histograms
from omninav.stages.features.grey_world import grey_world_pixels
from omninav.stages.features.hsv_histogram import hsv_histograms
from omninav.stages.geometry.appearance.segments import similarities
from omninav.stages.perturbation.changed_light import ChangedLight
from omninav.stages.recordings.opening import open_recording
from omninav.stages.unwarp.table import PanoramaTable
from omninav.stages.values.image import Image, Panorama, Pixels

HSV = ["features=hsv_histogram"]
LAB = ["features=colour_histogram", "nodes.features.space=lab", "nodes.features.bins=[0,16,16]"]
LOCAL = "nodes.features.grey_world=local"
TYPED: Mapping[str, list[str]] = {"as captured": HSV, "grey world, 90 degrees": [*HSV, LOCAL], "Lab": LAB}


def hsv(pixels: Pixels) -> Any:
    """omniview_mcl's features."""
    return hsv_histograms(pixels, 36, 16, 4, False, 64, 32)


FEATURES: Mapping[str, Callable[[Pixels], Any]] = {
    "as captured": hsv,
    "no brightness": lambda pixels: hsv_histograms(pixels, 36, 16, 1, False, 64, 32),
    "Lab, colour alone": lambda pixels: colour_histograms(pixels, 36, "lab", (0, 16, 16)),
    **{
        f"grey world, {width} degrees": lambda pixels, width=width: hsv(grey_world_pixels(pixels, width / 360))
        for width in (30, 60, 90, 120, 180, 360)
    },
}


def views(log: str) -> tuple[list[Pixels], Any]:
    """Panoramas of a drive and where they were taken: (N, 3)."""
    recording, table = open_recording(log), PanoramaTable(360, 80)
    assert recording.truth is not None
    images = [recording.image(frame) for frame in range(len(recording.stamps))]
    known = [n for n, image in enumerate(images) if image is not None and np.isfinite(recording.truth[n]).all()]
    shown = [table.panorama(Image(image), recording.camera).pixels for n in known if (image := images[n]) is not None]
    return shown, recording.truth[known]


def in_light(pixels: Pixels, light: Mapping[str, float]) -> Pixels:
    """A panorama as the stage shows it."""
    return ChangedLight(**light).step(Context("light", np.random.default_rng(0)), Panorama(pixels)).panorama.pixels


def nearest(on: DataSet) -> None:
    """Print a row per feature: the nearest image of the map."""
    (mapped, places), (seen, truth) = views(on.tour), views(on.drive)
    for name, described in FEATURES.items():
        references = np.stack([described(pixels) for pixels in mapped])
        cells = []
        for light in LIGHTS.values():
            best = [
                similarities(references, described(in_light(pixels, light)), 36, True, True, 0.5, None, 1.0)
                for pixels in seen[::3]
            ]
            chosen = places[[int(each.max(axis=1).argmax()) for each in best]]
            errors = np.hypot(*(chosen - truth[::3])[:, :2].T)
            cells.append(f"{np.median(errors):.2f} / {errors.mean():.2f} / {np.quantile(errors, 0.9):.2f}")
        print(f"| {on.name} | {name} | {' | '.join(cells)} |", flush=True)


def filtered(on: DataSet) -> None:
    """Print a row per feature: the filter, seeds 0 and 1."""
    wires = ["+wires.perturbation={panorama: unwarp.panorama}", "wires.features.panorama=perturbation.panorama"]
    for name, words in TYPED.items():
        print(f"| {on.name} | {name} | {' | '.join(in_each_light(on, [*wires, *words]))} |", flush=True)


def in_each_light(on: DataSet, words: Sequence[str]) -> list[str]:
    """A cell for each light: `omniview_mcl` with these words, seeds 0 and 1, the drive's images changed."""
    cells = []
    for light in LIGHTS.values():
        changed = [f"nodes.perturbation.{key}={value}" for key, value in light.items()]
        shown = []
        for seed in (0, 1):
            given = [*words, *changed, "perturbation=changed_light", "plots=none"]
            drive = {"tour": on.tour, "log": on.drive, "seed": seed}
            run = omninav.run("omniview_mcl", *given, progress=False, **drive)
            after: Any = run.metrics["after_convergence"]
            error = after["position_error_m"] or run.metrics["position_error_m"]
            lost = run.metrics["loss_rate"] if after["loss_rate"] is None else after["loss_rate"]
            shown.append(f"{error['median']:.2f} / {error['p90']:.2f} ({100 * lost:.0f} %)")
        cells.append(", ".join(shown))
    return cells


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--filter", action="store_true", help="the filter instead of the nearest image")
    given = parser.parse_args()
    print(f"| recording | features | {' | '.join(LIGHTS)} |\n|---|---|{'---|' * len(LIGHTS)}")
    for on in data_sets(given.data):
        (filtered if given.filter else nearest)(on)


if __name__ == "__main__":
    main()
