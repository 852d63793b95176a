"""What a recorded log costs beside what nobody can do without: decoding its images and unwarping them.

    python benchmarks/batch.py --data FOLDER

Processor time per image of variant=omniview_mcl on the house of the sample data, without plots, over decoding and
unwarping the same images alone, in turns; and of variant=topological_localisation.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from omninav.pipeline import Context
from omninav.pipeline.cli.main import main as omninav
from omninav.pipeline.engine.engine import Engine
from omninav.stages.recordings.opening import open_recording
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.image import Image

VARIANTS, WARM, ROUNDS = ("omniview_mcl", "topological_localisation"), 10, 3
LIMIT = 2.0


def alone(drive: str) -> float:
    """Milliseconds per image of decoding and unwarping."""
    recording, unwarp, ctx = open_recording(drive), UnwarpPanorama(), Context("unwarp")
    unwarp.setup(ctx)
    taken = []
    for frame in range(len(recording.stamps)):
        start = time.process_time()
        pixels = recording.image(frame)
        assert pixels is not None
        unwarp.step(ctx, image=Image(pixels), camera=recording.camera)
        taken.append(1e3 * (time.process_time() - start))
    return statistics.fmean(taken[WARM:])


def of_run(variant: str, learned: str, drive: str, folder: Path) -> float:
    """Milliseconds per image of a run's loop, with all that it writes; `learned`: tour=FILE or map=FILE."""
    taken: list[float] = []
    tick = Engine.tick

    def timed(engine: Engine) -> bool:
        start = time.process_time()
        went_on = tick(engine)
        if engine.graph.nodes.keys() >= {"match", "fusion"}:  # not the map's graph
            taken.append(1e3 * (time.process_time() - start))
        return went_on

    Engine.tick = timed  # type: ignore[method-assign]
    try:
        words = [f"variant={variant}", learned, f"log={drive}", "plots=none", "cache=null", f"hydra.run.dir={folder}"]
        with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
            if omninav(words):
                raise SystemExit(f"{' '.join(words)}: the run failed")
    finally:
        Engine.tick = tick  # type: ignore[method-assign]
    return statistics.fmean(taken[WARM:])


def main() -> int:
    """Print the figures; 1 where the ratio is beyond its limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    house = parser.parse_args().data / "photoreal-house"
    drive = str(house / "drive.mcap")
    least: list[float] = []
    found: dict[str, list[float]] = {variant: [] for variant in VARIANTS}
    with tempfile.TemporaryDirectory() as place:
        folders = {variant: Path(place) / variant for variant in VARIANTS}
        for variant, folder in folders.items():
            of_run(variant, f"tour={house / 'tour.mcap'}", drive, folder)
        for turn in range(ROUNDS):
            least.append(alone(drive))
            for variant, folder in folders.items():
                learned = f"map={folder / 'map.omap'}"
                found[variant].append(of_run(variant, learned, drive, Path(place) / f"{variant}_{turn}"))
    base = statistics.median(least)
    print(f"decoding and unwarping alone: {base:.2f} ms an image")
    for variant, taken in found.items():
        own = statistics.median(taken)
        print(f"{variant}: {own:.2f} ms an image, {own / base:.2f} times as much")
    return int(statistics.median(found["omniview_mcl"]) > LIMIT * base)


if __name__ == "__main__":
    raise SystemExit(main())
