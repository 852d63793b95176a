"""Image stamp to pose of a live run: a player in another process, omninav in this one, over DDS on loopback.

    python benchmarks/live.py --map office.omap --log drive.mcap            # 640x480 at 10 Hz, 500 particles: 50 ms
    python benchmarks/live.py --map … --log … --rate 30 unwarp=…            # whatever may be typed for omninav live

The log's images and odometry are sent again, with stamps of now, `--rate` images a second. Prints rate, latency
(median and 95th percentile) and how many images were overtaken.
"""

import argparse
import json
import multiprocessing
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

IMAGE, ODOMETRY = "/camera/image/compressed", "/odom"


def play(log: str, rate: float, seconds: float) -> None:
    """Send a log's images and odometry as if they were of now, odometry five times as often as images."""
    import numpy as np

    from omninav.pipeline.mcap.message_types import encode_message, standard_types
    from omninav.pipeline.mcap.reader import LogReader
    from omninav.stages.geometry.plane.se2 import interpolate
    from omninav.stages.live.transport import connect, disconnect
    from omninav.stages.plots.pose_messages import header, ros_pose
    from omninav.stages.recordings.messages import pose_of

    messages = list(LogReader(log).messages({IMAGE, ODOMETRY}))
    told = [each for each in messages if each.topic == ODOMETRY]
    images = [each for each in messages if each.topic == IMAGE and each.stamp >= told[0].stamp]
    start, rows = told[0].stamp, np.array([pose_of(each.content) for each in told])
    times = np.array([(each.stamp - start) / 1e9 for each in told])
    seen = np.array([(each.stamp - start) / 1e9 for each in images])
    transport, kind, sent = connect("dds"), images[0].msgtype, 0
    while sent < min(rate * seconds, len(images) - 1):
        now = time.time_ns()
        for part in range(5):
            stamp = now + round(part / 5 / rate * 1e9)
            at = seen[sent] + part / 5 * (seen[sent + 1] - seen[sent])
            pose = ros_pose(interpolate(times, rows, np.array([min(at, times[-1])]))[0])
            fields = {"header": header(stamp, "odom"), "pose": {"pose": pose}}
            transport.publish(ODOMETRY, "nav_msgs/msg/Odometry", encode_message("nav_msgs/msg/Odometry", fields))
            if part == 0:
                content = images[sent].content
                content.header.stamp.sec, content.header.stamp.nanosec = divmod(stamp, 10**9)
                transport.publish(IMAGE, kind, bytes(standard_types().serialize_cdr(content, kind)))
            time.sleep(max(0.0, (now + (part + 1) / 5 / rate * 1e9 - time.time_ns()) / 1e9))
        sent += transport.matched(IMAGE) > 0
    disconnect()


def main() -> None:
    """Play, run, print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--log", required=True)
    parser.add_argument("--map", required=True)
    parser.add_argument("--rate", type=float, default=10.0)
    parser.add_argument("--seconds", type=float, default=30.0)
    given, words = parser.parse_known_args()
    os.environ["ROS_DOMAIN_ID"] = str(100 + os.getpid() % 100)
    run = Path("runs/live_benchmark").absolute() / str(os.getpid())
    command = [sys.executable, "-m", "omninav", "live", f"map={given.map}", f"hydra.run.dir={run}", *words]
    camera = [] if any(word.startswith("camera=") for word in words) else [f"camera={camera_of(given.log, run)}"]
    player = multiprocessing.get_context("spawn").Process(target=play, args=(given.log, given.rate, given.seconds))
    player.start()
    robot = subprocess.Popen([*command, "nodes.prior.number=500", *camera], stdout=subprocess.DEVNULL)
    while player.is_alive() and robot.poll() is None:  # a log may be shorter than --seconds, and a word wrong
        time.sleep(0.1)
    player.terminate()
    robot.send_signal(signal.SIGINT)
    if robot.wait():
        sys.exit(robot.returncode)
    manifest = json.loads((run / "manifest.json").read_text())
    facts, dropped = manifest["facts"], manifest["dropped"]
    overtaken = sum(entry["count"] for kind, entry in dropped.items() if "overtaken" in kind)
    names = ("rate_hz", "latency_ms_median", "latency_ms_p95", "age_ms_median")
    print(json.dumps({"ticks": manifest["ticks"], "overtaken": overtaken} | {name: facts.get(name) for name in names}))


def camera_of(log: str, run: Path) -> Path:
    """The log's own camera as a file."""
    from omninav.stages.recordings.camera_yaml import write_camera
    from omninav.stages.recordings.opening import open_recording

    file = run.with_suffix(".camera.yaml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(write_camera(open_recording(log).camera))
    return file


if __name__ == "__main__":
    main()
