"""What a recorded log costs beside what nobody can do without: decoding its images and unwarping them.

    python benchmarks/batch.py --data FOLDER

Processor time per image of omninav, omniview_mcl and topological_localisation on the house of the sample data, without
plots, over decoding and unwarping the same images alone, in turns; and the Python calls of one tick of the built-in
world. What follows the loop is not in it: it is printed beside.
"""

import argparse
import os
import statistics
import sys
import tempfile
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from omninav.pipeline import Context
from omninav.pipeline.cli.main import main as omninav
from omninav.pipeline.engine.engine import Engine
from omninav.stages.recordings.opening import open_recording
from omninav.stages.unwarp.panorama import UnwarpPanorama
from omninav.stages.values.image import Image

VARIANTS, WARM, ROUNDS = ("omniview_mcl", "omninav", "topological_localisation"), 10, 3
LIMITS = {"omniview_mcl": 2.0, "omninav": 2.5}
"""Largest processor time of an image over that of decoding and unwarping it."""
COUNTED_TICK, MOST_CALLS = 30, 250
"""Tick whose Python calls are counted, and their largest number."""


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


def of_run(variant: str, learned: str, drive: str, folder: Path) -> tuple[float, float]:
    """Milliseconds per image of a run's loop, with all that it writes, and of what follows the loop.

    `learned`: tour=FILE or map=FILE.
    """
    taken: list[float] = []
    after: list[float] = []
    tick, finish = Engine.tick, Engine.finish

    def timed(engine: Engine) -> bool:
        start = time.process_time()
        went_on = tick(engine)
        if is_filter(engine):
            taken.append(1e3 * (time.process_time() - start))
        return went_on

    def timed_finish(engine: Engine) -> dict[str, Any]:
        start = time.process_time()
        found = finish(engine)
        if is_filter(engine):
            after.append(1e3 * (time.process_time() - start))
        return found

    Engine.tick, Engine.finish = timed, timed_finish  # type: ignore[method-assign]
    try:
        run(f"variant={variant}", learned, f"log={drive}", f"hydra.run.dir={folder}")
    finally:
        Engine.tick, Engine.finish = tick, finish  # type: ignore[method-assign]
    return statistics.fmean(taken[WARM:]), sum(after) / len(taken)


def calls_of_a_tick(folder: Path) -> int:
    """Python calls of one tick of omniview_mcl in the built-in world."""
    calls = 0
    tick = Engine.tick

    def count(frame: Any, event: str, argument: Any) -> None:
        nonlocal calls
        calls += event == "call"

    def counted(engine: Engine) -> bool:
        if not (is_filter(engine) and engine.ticks == COUNTED_TICK):
            return tick(engine)
        sys.setprofile(count)
        try:
            return tick(engine)
        finally:
            sys.setprofile(None)

    Engine.tick = counted  # type: ignore[method-assign]
    try:
        run("variant=omniview_mcl", f"hydra.run.dir={folder}")
    finally:
        Engine.tick = tick  # type: ignore[method-assign]
    return calls


def is_filter(engine: Engine) -> bool:
    """Tells a run's own graph from that of its map."""
    return engine.graph.nodes.keys() >= {"match", "fusion"}


def run(*words: str) -> None:
    """Run a job without plots and without what earlier runs left."""
    with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere), redirect_stderr(nowhere):
        if omninav([*words, "plots=none", "cache=null"]):
            raise SystemExit(f"{' '.join(words)}: the run failed")


def main() -> int:
    """Print the figures; 1 where one is beyond its limit."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--data", type=Path, required=True, help="folder of the sample recordings")
    house = parser.parse_args().data / "photoreal-house"
    drive = str(house / "drive.mcap")
    least: list[float] = []
    found: dict[str, list[tuple[float, float]]] = {variant: [] for variant in VARIANTS}
    with tempfile.TemporaryDirectory() as place:
        calls = calls_of_a_tick(Path(place) / "calls")
        folders = {variant: Path(place) / variant for variant in VARIANTS}
        for variant, folder in folders.items():
            of_run(variant, f"tour={house / 'tour.mcap'}", drive, folder)
        for turn in range(ROUNDS):
            least.append(alone(drive))
            for variant, folder in folders.items():
                learned = f"map={folder / 'map.omap'}"
                found[variant].append(of_run(variant, learned, drive, Path(place) / f"{variant}_{turn}"))
    base, beyond = statistics.median(least), calls > MOST_CALLS
    print(f"Python calls of a tick: {calls}")
    print(f"decoding and unwarping alone: {base:.2f} ms an image")
    for variant, taken in found.items():
        own, after = (statistics.median(part) for part in zip(*taken, strict=True))
        beyond = beyond or own > LIMITS.get(variant, float("inf")) * base
        print(f"{variant}: {own:.2f} ms an image, {own / base:.2f} times as much; {after:.2f} ms after the loop")
    return int(beyond)


if __name__ == "__main__":
    raise SystemExit(main())
