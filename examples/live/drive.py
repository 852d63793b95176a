"""Two processes over ROS 2: a simulated robot, and omninav that drives it to the kitchen; see README.md beside it.

On the way the camera stops for ten seconds, and omninav is killed and resumed. At the end the record of the drive is
run again, and its results must be the same bytes.
"""

import argparse
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

SAME = ("trajectory.tum", "metrics.json", "frames.csv", "result.mcap")


def omninav(*words: str, python: str = sys.executable) -> list[str]:
    """The command line of omninav."""
    return [python, "-m", "omninav", *words]


def wait_for(path: Path, writer: subprocess.Popen[bytes], seconds: float = 600.0) -> None:
    """Until a process has written a file."""
    until = time.monotonic() + seconds
    while not path.exists():
        if writer.poll() is not None:
            raise SystemExit(f"{writer.args} ended before it wrote {path}; a robot's messages are in robot.log")
        if time.monotonic() > until:
            raise SystemExit(f"{path} did not appear in {seconds:.0f} s")
        time.sleep(0.2)


def main(arguments: Sequence[str] | None = None) -> int:
    """Drive, kill, resume, run again, compare."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot-python", default=sys.executable, help="Python of the robot, for one that has rclpy")
    parser.add_argument("--robot", default="ros2", choices=("ros2", "dds"), help="what the robot speaks")
    parser.add_argument("--map", help="a map of the office (.omap); none: one is made from a tour of it")
    parser.add_argument("--kill-after", type=float, default=45.0, help="seconds")
    parser.add_argument("--seconds", type=float, default=300.0, help="how long the drive may take")
    given = parser.parse_args(arguments)
    folder = Path("runs/live_example").absolute()
    folder.mkdir(parents=True, exist_ok=True)
    os.environ.setdefault("ROS_DOMAIN_ID", str(40 + os.getpid() % 60))
    camera, run = folder / "robot.camera.yaml", folder / f"drive_{os.getpid()}"
    camera.unlink(missing_ok=True)
    if given.map is None:
        tour = folder / "map"
        words = ("map", "variant=topological_nav", "world=office", "route=tour", "day=0", f"hydra.run.dir={tour}")
        if not (tour / "map.omap").exists():
            subprocess.run(omninav(*words), check=True)
        given.map = str(tour / "map.omap")

    stops = "nodes.driver.camera_stops=[{at: 20, seconds: 10}]"
    words = ("simulate", f"live={given.robot}", "world=office", "day=2", f"camera={camera}", stops)
    robot = subprocess.Popen(omninav(*words, python=given.robot_python), stderr=(folder / "robot.log").open("w"))
    try:
        wait_for(camera, robot)
        common = ("variant=topological_nav", "goal=kitchen", f"map={given.map}")
        ends = ("nodes.source.rest_s=2", f"nodes.source.seconds={given.seconds}")
        node = subprocess.Popen(omninav("live", *common, *ends, f"camera={camera}", f"hydra.run.dir={run}"))
        wait_for(run / "live.mcap.unfinished", node)
        time.sleep(given.kill_after)
        node.send_signal(signal.SIGKILL)
        node.wait()
        print("killed; it continues with its map and its belief", flush=True)
        subprocess.run(omninav("resume", str(run)), check=True)
    finally:
        robot.terminate()
        robot.wait()

    again = folder / f"again_{os.getpid()}"
    words = ("source=replay", f"log={run / 'live.mcap'}", f"hydra.run.dir={again}")
    subprocess.run(omninav(*common, *words), check=True)
    differ = [name for name in SAME if (run / name).read_bytes() != (again / name).read_bytes()]
    print(f"differ: {', '.join(differ)}" if differ else f"the same bytes: {', '.join(SAME)}")
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
