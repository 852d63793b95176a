"""Large inputs: `benchmarks/scale.py images`, `odometry` or `references`, and how many where not the full number.

`images`: a run over 100,000 images; printed every 10,000: memory of the process, frames per second; then the sizes of
what it leaves and how long its page takes to read. `odometry`: the same for 1,000,000 odometry messages between two
images. `references`: a map of 100,000 reference images, learned, saved, loaded and localised in. All logs are streamed
to a temporary folder, panoramas of 48 x 16 pixels of a drive on a circle; every run is a process of its own.
"""

import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from omninav.pipeline.mcap.writer import written_log  # noqa: E402

CAMERA = b"projection: cylindrical\nimage: {width: 48, height: 16}\ncolumn_of_forward: 24\n"
PLACES = 200
"""Different images on a lap of the circle."""
RADIUS_M, INTERVAL_S = 5.0, 0.1
EVERY = 10_000
NUMBERS = {"images": 100_000, "odometry": 1_000_000, "references": 100_000}


def images() -> list[bytes]:
    """One JPEG for each place, as smooth along the way as around the robot."""
    noise = np.random.default_rng(0).normal(size=(PLACES, 16, 48, 3)).astype(np.float32)
    smooth = np.stack([cv2.GaussianBlur(each, (0, 0), 2) for each in noise])
    along = np.exp(-0.5 * (np.minimum(np.arange(PLACES), PLACES - np.arange(PLACES)) / 4.0) ** 2)
    mixed = np.fft.ifft(np.fft.fft(smooth, axis=0) * np.fft.fft(along)[:, None, None, None], axis=0).real
    scaled = cv2.normalize(mixed.reshape(-1), None, 0, 255, cv2.NORM_MINMAX).reshape(mixed.shape).astype(np.uint8)
    return [bytes(cv2.imencode(".jpg", each)[1]) for each in scaled]


def pose_fields(place: float) -> dict[str, object]:
    """The pose at a place of the circle, counted in images."""
    angle = 2 * math.pi * place / PLACES
    return {
        "position": {"x": RADIUS_M * math.sin(angle), "y": RADIUS_M * (1 - math.cos(angle))},
        "orientation": {"z": math.sin(angle / 2), "w": math.cos(angle / 2)},
    }


def write_log(path: Path, frames: int, between: int = 1, crowded: int = -1, far: float = 0.0) -> Path:
    """A log of so many images, with one odometry message each, but `between` of them after image `crowded`.

    `far`: metres that each lap lies further out than the one before, for references that differ.
    """
    encoded = images()
    with written_log(path) as log:
        log.attach("camera.yaml", CAMERA)
        for frame in range(frames):
            stamp = 10**18 + round(frame * INTERVAL_S * 1e9)
            content = {"header": {"frame_id": "camera"}, "format": "jpeg"}
            data = np.frombuffer(encoded[frame % PLACES], np.uint8)
            log.write("/camera/image/compressed", "sensor_msgs/msg/CompressedImage", stamp, content | {"data": data})
            for topic, kind, many in (
                ("/odom", "nav_msgs/msg/Odometry", between if frame == crowded else 1),
                ("/ground_truth/pose", "geometry_msgs/msg/PoseStamped", 1),
            ):
                for number in range(many):
                    part = number / many
                    pose = pose_fields(frame + part)
                    pose["position"]["x"] += far * (frame // PLACES)  # type: ignore[index]
                    fields = {"pose": {"pose": pose}} if kind.endswith("Odometry") else {"pose": pose}
                    at = stamp + round(part * INTERVAL_S * 1e9)
                    log.write(topic, kind, at, {"header": {"frame_id": "odom"}, **fields})
    return path


def measured(words: list[str]) -> Iterator[tuple[int, float, float]]:
    """Run `omninav` with these words: frames done, seconds and megabytes, whenever it tells of frames; then -1.

    Raises SystemExit with what it said where it fails.
    """
    began = time.perf_counter()
    command = [sys.executable, "-m", "omninav", *words]
    process = subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stderr is not None
    assert process.stdout is not None
    lines: list[str] = []
    for line in process.stderr:
        lines.append(line)
        try:
            state = json.loads(line)
        except ValueError:
            continue
        pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
        yield int(state.get("frames", 0)), time.perf_counter() - began, pages * resource.getpagesize() / 1e6
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(words)}: exit status {process.returncode}\n{''.join(lines[-5:])}{said}")
    yield -1, time.perf_counter() - began, used.ru_maxrss / 1e3


def table(words: list[str], every: int = EVERY) -> None:
    """Run `omninav` and print memory over its frames."""
    print(f"{'frames':>10} {'s':>8} {'MB':>8}")
    due = 0
    for frames, seconds, megabytes in measured(words):
        if frames < 0:
            print(f"{'end':>10} {seconds:8.1f} {megabytes:8.1f} (largest)", flush=True)
        elif frames >= due:
            print(f"{frames:10d} {seconds:8.1f} {megabytes:8.1f}", flush=True)
            due = (frames // every + 1) * every


def sizes(folder: Path) -> None:
    """What a run left, by size."""
    for file in sorted(folder.resolve().iterdir()):
        if file.is_file() and file.stat().st_size > 100_000:
            print(f"{file.name:24} {file.stat().st_size / 1e6:10.1f} MB")
    page = folder / "report.html"
    print(f"report.html: {page.stat().st_size / 1e6:.2f} MB, {page.read_text().count('<'):,} elements")


def main() -> int:
    """One of the three."""
    what = sys.argv[1] if len(sys.argv) > 1 else ""
    if what not in NUMBERS:
        print(f"type benchmarks/scale.py {' or '.join(NUMBERS)}")
        return 2
    number = int(sys.argv[2]) if len(sys.argv) > 2 else NUMBERS[what]
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        common = [f"runs={folder}/runs", "cache=null", "start=truth"]
        tour = write_log(folder / "tour.mcap", 2 * PLACES)
        if what == "images":
            log = write_log(folder / "drive.mcap", number)
            print(f"{number} images, {log.stat().st_size / 1e6:.0f} MB")
            table([f"tour={tour}", f"log={log}", *common], max(1, number // 10))
        elif what == "odometry":
            log = write_log(folder / "drive.mcap", 20, number, 10)
            print(f"{number} odometry messages between two of 20 images, {log.stat().st_size / 1e6:.0f} MB")
            table([f"tour={tour}", f"log={log}", *common])
        else:
            log = write_log(folder / "tour.mcap", number, far=2.5 * RADIUS_M)
            print(f"a tour of {number} images, {log.stat().st_size / 1e6:.0f} MB, each a reference")
            table(["map", "variant=omniview_mcl", f"log={log}", *common])
            learned = (folder / "runs" / "latest" / "map.omap").resolve()
            print(f"map.omap: {learned.stat().st_size / 1e6:.1f} MB")
            table([f"map={learned}", f"log={write_log(folder / 'drive.mcap', 50)}", *common], 1)
        sizes(folder / "runs" / "latest")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
