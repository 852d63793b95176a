"""A localiser that is a program: what it is given, what it leaves, and what happens where it fails."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import BadInput, Context, Tick
from omninav.stages.mapping.recorded_images import CollectImages, EncodeImage
from omninav.stages.metrics.outside_localiser import OutsideLocaliser
from omninav.stages.recordings.camera_yaml import read_camera
from omninav.stages.recordings.recorded_images import RecordedImages
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Motion, Pose

CAMERA = read_camera(Path(__file__).resolve().parents[2] / "data" / "camera.yaml")
TICKS = [Tick(n, 10**18 + n * 500_000_000, 0, n, n == 0) for n in range(4)]
TRUTH: list[Pose | None] = [Pose(2.0 + n, 1.0, 0.5) for n in range(4)]
MOTION = [Motion(1.0, 0.0, 0.0) if n else None for n in range(4)]
ECHO = """
import csv, json, sys
rows = list(csv.DictReader(open(sys.argv[-1] + "/drive/images.csv")))
lines = ["time,x,y,heading,cpu_ms"]
for number, row in enumerate(rows):
    x = 2.0 + float(row["odometry_x"])
    lines.append(f"{row['time']},{x},1.25,0.5,{10 + number}" if number != 2 else f"{row['time']},,,,40")
open(sys.argv[-1] + "/poses.csv", "w").write("\\n".join(lines))
open(sys.argv[-1] + "/kept.bin", "wb").write(b"0" * 3000)
"""


def images(truth: list[Pose | None]) -> RecordedImages:
    pictures = [Image(np.full((CAMERA.height_px, CAMERA.width, 3), 10 * n, np.uint8)) for n in range(4)]
    encoded = [EncodeImage().step(Context("encoded"), each).encoded for each in pictures]
    odometry = [Pose(float(n), 0.0, 0.0) for n in range(4)]
    return CollectImages().step(Context("images"), TICKS, encoded, CAMERA, odometry, truth).images


def located(folder: Path, program: str, truth: list[Pose | None] = TRUTH, command: str = "") -> OutsideLocaliser.Out:
    """Runs a program of one's own, or a command."""
    (folder / "mine.py").write_text(program)
    stage = OutsideLocaliser(command=command or f"python {folder / 'mine.py'}")
    return stage.step(Context("drive", folder=folder), images(truth), images(TRUTH), TICKS, TRUTH, MOTION)


def test_its_poses_are_the_estimates_and_an_image_without_one_has_none(tmp_path: Path):
    out = located(tmp_path, ECHO)
    assert out.drive.estimate[:, 0] == pytest.approx([2.0, 3.0, np.nan, 5.0], nan_ok=True)
    assert out.drive.truth[:, 0].tolist() == [2.0, 3.0, 4.0, 5.0]
    found = out.metrics.values["peer"]
    assert (found["without_pose"], found["kept_mb"], found["image_cpu_ms"]) == (0.25, 0.003, 12.0)
    assert found["lines"] == len([line for line in ECHO.splitlines() if line])
    stated_s = 0.074  # 10, 11, 40 and 13 ms
    assert found["map_cpu_s"] == pytest.approx(max(0.0, found["cpu_s"] - stated_s))


def test_a_tum_file_will_do_and_an_empty_one_says_that_no_image_has_a_pose(tmp_path: Path):
    row = f"{TICKS[1].stamp / 1e9:.6f} 7 8 0 0 0 1 0"
    write = "import sys; open(sys.argv[-1] + '/poses.tum', 'w').write('{}')"
    out = located(tmp_path, write.format(row))
    assert out.drive.estimate[1] == pytest.approx([7.0, 8.0, np.pi])
    assert out.metrics.values["peer"]["image_cpu_ms"] is None
    assert np.isnan(located(tmp_path, write.format("")).drive.estimate).all()


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("import sys; print('pycolmap is missing'); sys.exit('pip install pycolmap')", "ended with 1: pip install"),
        ("raise ValueError('no points')", "ended with 1: ValueError: no points"),
        ("pass", r"it left no poses.csv and no poses.tum"),
        ("write('hello')", "poses.csv: no column for time and x and y among 'hello'"),
        ("write('time,x,y\\n1000000000.0,1,2')", "a pose without a heading"),
        ("write('time,x,y,heading\\n17.5,1,2,0')", "17.500000 s is the time of no image of drive/images.csv"),
        ("write('time,x,y,heading\\n1000000000,1,2,0\\n1000000000,1,2,0')", "two poses of one image"),
        ("write('time,x,y,heading\\n1000000000,1e40,2,0')", "out of all proportion"),
        ("write('time,x,y,heading\\n1000000000,1,2,90')", "headings of up to 90 are read as radians"),
        ("write('time,x,y,qx,qy,qz,qw\\n1000000000,1,2,1,0,0,0')", "is w the first of their quaternions"),
        ("write('time,x,y,heading\\n1000000000,1,two,0')", "1 row with x or y alone, the first at 1000000000.000000 s"),
        ("write('time,x,y,heading'); open(sys.argv[-1] + '/poses.tum', 'w')", "it left poses.csv and poses.tum; leave"),
        ("write('time,x,y,heading\\n,1,2,0.5')", "a pose without a time"),
        ("write('time,x,y,heading' + 5 * '\\n1000000000,1,2,0')", "5 poses of 4 images"),
    ],
)
def test_what_is_wrong_is_said_in_its_words_or_with_the_file(tmp_path: Path, program: str, said: str):
    write = "import sys\ndef write(text): open(sys.argv[-1] + '/poses.csv', 'w').write(text)\n"
    with pytest.raises(BadInput, match=said):
        located(tmp_path, write + program)


def test_a_map_without_poses_is_refused(tmp_path: Path):
    with pytest.raises(BadInput, match="no true poses"):
        located(tmp_path, ECHO, [None] * 4)


@pytest.mark.parametrize(
    ("command", "what"),
    [
        ("python 'mine.py", "No closing quotation"),
        (" ", "no program; type"),
        ("no_such_localiser", "no program that can be run"),
        ("python gone.py", "no file 'gone.py'"),
    ],
)
def test_a_command_that_cannot_be_read_is_refused_before_anything_is_run(command: str, what: str):
    with pytest.raises(BadInput, match=f"^command: .*{what}"):
        OutsideLocaliser(command=command).inputs_digest()


def test_its_program_is_part_of_what_a_result_follows_from(tmp_path: Path):
    program, stage = tmp_path / "mine.py", OutsideLocaliser(command=f"python {tmp_path / 'mine.py'}")
    for file in (program, tmp_path / "imported.py"):
        digests = []
        for text in ("1", "2", "1"):
            file.write_text(text)
            digests.append(stage.inputs_digest())
        assert digests[0] == digests[2] != digests[1]


def test_a_word_longer_than_the_name_of_a_file_is_none_and_lines_are_of_text_alone(tmp_path: Path):
    assert OutsideLocaliser(command=f"python -c '{'1;' * 200}'").inputs_digest() is None
    (tmp_path / "binary").write_bytes(b"a\n\0\n")
    out = located(tmp_path, ECHO, command=f"python {tmp_path / 'mine.py'} {tmp_path / 'binary'}")
    assert out.metrics.values["peer"]["lines"] == len([line for line in ECHO.splitlines() if line])


LONG = """
import os, subprocess, sys, time
child = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
with open(os.path.dirname(__file__) + "/part", "w") as file:
    file.write(f"{os.getpid()} {child.pid}")
os.replace(os.path.dirname(__file__) + "/part", os.path.dirname(__file__) + "/pids")
"""


def test_whoever_stops_the_run_stops_a_program_that_never_ends_and_what_it_has_started(tmp_path: Path):
    def stop(*_: object) -> None:
        if (tmp_path / "pids").exists():
            raise KeyboardInterrupt
        signal.setitimer(signal.ITIMER_REAL, 0.05)

    before = signal.signal(signal.SIGALRM, stop)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.05)
        with pytest.raises(KeyboardInterrupt):
            located(tmp_path, LONG + "time.sleep(600)")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert_ended(tmp_path)


@pytest.mark.parametrize("by", [signal.SIGKILL, signal.SIGTERM])
def test_it_ends_with_a_process_that_is_killed(tmp_path: Path, by: signal.Signals):
    (tmp_path / "mine.py").write_text(LONG + "time.sleep(600)")
    start = "import sys; from omninav.stages.metrics.outside_localiser import wait; from pathlib import Path\n"
    start += f"wait(['python', {str(tmp_path / 'mine.py')!r}], Path(), open({str(tmp_path / 'log')!r}, 'wb'))"
    process = subprocess.Popen([sys.executable, "-c", start])
    while not (tmp_path / "pids").exists() and process.poll() is None:
        time.sleep(0.05)
    process.send_signal(by)
    process.wait()
    assert_ended(tmp_path)


def test_what_it_leaves_running_ends_with_it(tmp_path: Path):
    located(tmp_path, LONG + ECHO)
    assert_ended(tmp_path)


def assert_ended(tmp_path: Path) -> None:
    """The system takes a moment to clear a process away."""
    pids, until = [*map(int, (tmp_path / "pids").read_text().split())], time.monotonic() + 20
    while any(map(_runs, pids)) and time.monotonic() < until:
        time.sleep(0.05)
    left = [pid for pid in pids if _runs(pid)]
    for pid in left:
        os.kill(pid, signal.SIGKILL)
    assert not left


def _runs(pid: int) -> bool:
    state = Path(f"/proc/{pid}/stat")
    try:
        os.kill(pid, 0)
        return not state.exists() or state.read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False
