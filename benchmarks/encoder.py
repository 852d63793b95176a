"""How far the nearest image by a network's vectors is from the truth: the table of docs/experiments/encoder.md.

    python benchmarks/encoder.py --data FOLDER --model encoder.onnx

`encoder.onnx` is what examples/encoder/make_encoder.py writes. Errors in metres, median / mean / 90 %, every third
image, plain (`match=cosine`) and whitened by the map's own images (`match=whitened`), in the light of
benchmarks/light.py.
"""

import argparse
from pathlib import Path

import numpy as np
from light import LIGHTS, in_light, views
from variants import DataSet, data_sets

from omninav import Context
from omninav.stages.features.onnx_encoder import OnnxEncoder
from omninav.stages.geometry.appearance.segments import cosine_similarities
from omninav.stages.geometry.appearance.whitening import Whitening, learned_whitening
from omninav.stages.values.image import Panorama, Pixels

HEADINGS = 36
WHITENED = (None, 16, 32, 64, 112)
"""Components; None: as the network gives them."""


def nearest(on: DataSet, encoder: OnnxEncoder) -> None:
    """Print a row per number of components."""
    ctx = Context("features")
    (mapped, places), (seen, truth) = views(on.tour), views(on.drive)

    def described(pixels: Pixels) -> np.ndarray:
        return encoder.step(ctx, Panorama(pixels)).features.values

    references = np.stack([described(pixels) for pixels in mapped])
    queries = {name: [described(in_light(p, light)) for p in seen[::3]] for name, light in LIGHTS.items()}
    for components in WHITENED:
        own: Whitening | None = None
        if components is not None:
            own = learned_whitening(references.reshape(-1, references.shape[2]), components)
        known = references if own is None else own.of(references)
        cells = []
        for seen_so in queries.values():
            given = seen_so if own is None else [own.of(view) for view in seen_so]
            chosen = places[[int(cosine_similarities(known, v, HEADINGS).max(axis=1).argmax()) for v in given]]
            errors = np.hypot(*(chosen - truth[::3])[:, :2].T)
            cells.append(f"{np.median(errors):.2f} / {errors.mean():.2f} / {np.quantile(errors, 0.9):.2f}")
        print(f"| {on.name} | {'plain' if own is None else components} | {' | '.join(cells)} |", flush=True)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    parser.add_argument("--model", required=True, help="the network, an .onnx file")
    parser.add_argument("--segments", type=int, default=8, help="as nodes.features.segments")
    parser.add_argument("--size", type=int, nargs=2, default=(96, 64), help="as nodes.features.size")
    given = parser.parse_args()
    encoder = OnnxEncoder(model=given.model, segments=given.segments, size=tuple(given.size))
    encoder.setup(Context("features"))
    print(f"| recording | components | {' | '.join(LIGHTS)} |\n|---|---|{'---|' * len(LIGHTS)}")
    for on in data_sets(given.data):
        nearest(on, encoder)


if __name__ == "__main__":
    main()
