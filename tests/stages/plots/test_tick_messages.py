import numpy as np
import pytest
from result_of import shown_of
from small_run import mixture_run, small_run

from omninav.pipeline.mcap.message_types import encode_message
from omninav.stages.geometry.plane.se2 import between, compose
from omninav.stages.plots.foxglove_server import FoxgloveServer
from omninav.stages.plots.markers import GREEN, PINK, gaussian_markers, homing_arrow, weighted_points
from omninav.stages.plots.panorama_snapshot import EncodedPanorama
from omninav.stages.plots.pose_messages import covariance_6x6, header, pose_messages, ros_pose, transform
from omninav.stages.plots.thin_belief import thin
from omninav.stages.plots.tick_messages import ORDER, PATH_TICKS, PathSoFar, by_tick, tick_messages
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.command import Command
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.homing import HomingVector
from omninav.stages.values.similarity import Similarities

FRAMES = 20
SEEN = Similarities(np.random.default_rng(3).random((40, 12), dtype=np.float32))
VECTOR = HomingVector(0, 0.5, 0.1, 1.0, 1.0, 1.0, 1.5, 30, "tracking")
INPUTS = {
    "similarities": SEEN,
    "confidence": PoseConfidence(0.8),
    "command": Command(0.2, 0.1),
    "vector": VECTOR,
    "panorama": EncodedPanorama(b"\xff\xd8 a picture"),
}


@pytest.fixture(scope="module")
def run():
    return small_run(frames=FRAMES, logs=2)


@pytest.fixture(scope="module")
def made(run) -> list[dict[str, bytes]]:
    shown = shown_of(run, **INPUTS)
    return [{topic: data for topic, _, data in tick} for tick in by_tick(tick_messages(shown, PathSoFar()), len(shown))]


def test_each_message_is_the_one_that_is_encoded_by_itself(run, made):
    odometry = np.zeros(3)
    for n, tick in enumerate(run.ticks):
        stamp, estimate, true = tick.stamp, run.estimates[n], run.truth[n]
        moved = run.motion[n]
        odometry = np.zeros(3) if moved is None else compose(odometry, (moved.x, moved.y, moved.turn))
        at = np.array([estimate.pose.x, estimate.pose.y, estimate.pose.heading])
        correction = compose(at, between(odometry, np.zeros(3)))
        belief, best = run.beliefs[n], SEEN.values.max(axis=1).astype(np.float64)
        first = np.argsort(-best, kind="stable")
        similar = weighted_points(stamp, "similarity", GREEN, 0.2, run.map.poses[first, :2], best[first])
        head, pose = header(stamp), {"pose": ros_pose(at), "covariance": covariance_6x6(estimate.covariance)}
        frames = [transform(stamp, "map", "odom", correction), transform(stamp, "odom", "base_link", odometry)]
        expected = {
            "/tf": ("tf2_msgs/msg/TFMessage", {"transforms": frames}),
            "/odom": (
                "nav_msgs/msg/Odometry",
                {
                    "header": header(stamp, "odom"),
                    "child_frame_id": "base_link",
                    "pose": {"pose": ros_pose(odometry)},
                },
            ),
            "/ground_truth/pose": (
                "geometry_msgs/msg/PoseStamped",
                {"header": head, "pose": ros_pose(np.array([true.x, true.y, true.heading]))},
            ),
            "/estimate/pose": ("geometry_msgs/msg/PoseWithCovarianceStamped", {"header": head, "pose": pose}),
            "/estimate/confidence": ("std_msgs/msg/Float64", {"data": 0.8}),
            "/belief": (
                "geometry_msgs/msg/PoseArray",
                {"header": head, "poses": pose_messages(thin(belief, 30).poses)},
            ),
            "/similarity/best": ("std_msgs/msg/Float64", {"data": best.max()}),
            "/similarity": ("visualization_msgs/msg/MarkerArray", {"markers": [similar]}),
            "/panorama/compressed": (
                "sensor_msgs/msg/CompressedImage",
                {"header": header(stamp, "base_link"), "format": "jpeg", "data": b"\xff\xd8 a picture"},
            ),
            "/homing": ("visualization_msgs/msg/MarkerArray", {"markers": [homing_arrow(stamp, 0.5, 1.5)]}),
            "/command": (
                "geometry_msgs/msg/TwistStamped",
                {"header": header(stamp, "base_link"), "twist": {"linear": {"x": 0.2}, "angular": {"z": 0.1}}},
            ),
        }
        for topic, (msgtype, fields) in expected.items():
            assert made[n][topic] == encode_message(msgtype, fields), (n, topic)


def test_the_path_so_far_is_that_of_the_log_and_comes_every_16_ticks(run, made):
    assert [n for n, tick in enumerate(made) if "/estimate/path" in tick] == [PATH_TICKS, 2 * PATH_TICKS]
    stamps = [tick.stamp for tick in run.ticks[FRAMES : 2 * PATH_TICKS + 1]]
    poses = [
        {"header": header(stamp), "pose": ros_pose(np.array([one.pose.x, one.pose.y, one.pose.heading]))}
        for stamp, one in zip(stamps, run.estimates[FRAMES:], strict=False)
    ]
    path = {"header": header(stamps[-1]), "poses": poses}
    assert made[2 * PATH_TICKS]["/estimate/path"] == encode_message("nav_msgs/msg/Path", path)


def test_the_ellipses_of_a_mixture_are_those_that_are_encoded_by_themselves(run):
    learned, beliefs, *_ = mixture_run(run)
    three = GaussianMixture(*(np.concatenate([part, part[:1]]) for part in _parts(beliefs[5])))
    beliefs = [*beliefs[:5], three, *beliefs[6:]]
    shown = shown_of(run, beliefs, learned)
    for n, tick in enumerate(by_tick(tick_messages(shown, PathSoFar()), len(shown))):
        lines = gaussian_markers(run.ticks[n].stamp, "belief", PINK, *_parts(beliefs[n]))
        alone = encode_message("visualization_msgs/msg/MarkerArray", {"markers": [lines]})
        assert {topic: data for topic, _, data in tick}["/belief/markers"] == alone


def _parts(belief: GaussianMixture):
    return belief.means, belief.covariances, belief.weights


def test_ticks_one_by_one_give_what_they_give_together(run, made):
    before = PathSoFar()
    for n, shown in enumerate(shown_of(run, **INPUTS)):
        (alone,) = by_tick(tick_messages([shown], before), 1)
        assert {topic: data for topic, _, data in alone} == made[n]
        assert sorted(topics := [topic for topic, _, _ in alone], key=ORDER.index) == topics


def test_no_message_is_made_of_a_topic_that_nobody_watches(run):
    class Channel:
        def __init__(self, number: int, watched: bool) -> None:
            self.number, self.watched, self.sent = number, watched, []

        def id(self) -> int:
            return self.number

        def has_sinks(self) -> bool:
            return self.watched

        def log(self, data: bytes, log_time: int) -> None:
            self.sent.append((data, log_time))

    class Listener:
        def broadcast_time(self, stamp: int) -> None:
            pass

    class Subscribed:
        id = 0

    (shown, *_) = shown_of(run, **INPUTS)
    messages, encoded = tick_messages([shown], PathSoFar()), []
    for each in messages:
        each.encode = lambda topic=each.topic, encode=each.encode: encoded.append(topic) or encode()
    server = FoxgloveServer(None, server=Listener())
    server.channels = {each.topic: Channel(n, each.topic == "/tf") for n, each in enumerate(messages)}
    server.send(7, messages)
    assert encoded == ["/tf"]
    server.on_subscribe(None, Subscribed)
    assert encoded == ["/tf", messages[0].topic]
    assert [stamp for _, stamp in server.channels[messages[0].topic].sent] == [7]
