"""A recording out of ROS topics, whatever file they came from: frames, odometry and truth at the frames' stamps."""

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline import nearest, shown
from omninav.pipeline.mcap.message import BadMessage, Record
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.values.encoded_image import Undecodable

from .camera_yaml import camera_from_info, parse_camera, read_camera
from .clock_changes import camera_clock_set, set_back
from .messages import IMAGE_TYPES, POSE_TYPES, SCAN_TYPE, TRANSFORMS_TYPES, ImpossiblePose, pixels_of, pose_of
from .named_camera import named_camera
from .plausibility import MotionLimits, silent, squares_within
from .pose_topic import MAX_STAMP, NOWHERE, PoseTopic, PoseTrack, TransformTopic
from .recording import OpenOptions, Topics, UnreadableRecording
from .stamps import Stamps, max_step_s, poses_at, within
from .static_transforms import TF_STATIC, StaticTransforms
from .topic_recording import Feed, TopicRecording, in_order, message_of, require_stamps

FRAMES_ASKED = 4
"""Number of the first images whose cameras are compared."""
ODOMETRY_FRAMES = "/tf:odom:"
"""Transforms that are odometry by the convention of ROS (REP 105), to whichever frame of the robot."""
IMAGE_TOPICS = ("/camera/image/compressed", "/camera/image")


def record_topics(name: str, feed: Feed, options: OpenOptions, files: Sequence[Path]) -> TopicRecording:
    """A recording from a feed of messages.

    Camera: a camera.yaml named by the user; else one attached, else one beside the file, else CameraInfo.
    Raises `UnreadableRecording` where a topic is missing, or nothing usable remains.
    """
    topics = options.topics
    if odometry_in_transforms := _odometry_in_transforms(feed, topics):
        topics = replace(topics, odometry=ODOMETRY_FRAMES)
    named = [each for each in (topics.odometry, topics.truth) if each]
    transforms = {each: TransformTopic(each) for each in named if ":" in each}
    poses: dict[str, PoseTopic] = {**{each: PoseTopic(each) for each in named}, **transforms}
    moving = {each.topic for each in transforms.values()}
    wanted = {topic for topic in (topics.camera_info, topics.scan) if topic} | {each.topic for each in poses.values()}
    wanted |= {topics.image} if topics.image else set(IMAGE_TOPICS)
    wanted.add(TF_STATIC)
    records: dict[str, list[Record]] = {topic: [] for topic in wanted}
    infos: list[Any] = []
    fixed, base = StaticTransforms(), ""
    for record in feed.scan(wanted):
        try:
            if record.topic in moving:
                taken_by = (each for each in transforms.values() if each.topic == record.topic)
                _add_transforms(feed, name, record, *(partial(each.add_message, record) for each in taken_by))
                continue
            if record.topic in poses:
                message = feed.decode(record.topic, record.data)
                if record.topic == topics.odometry and not base:
                    base = str(getattr(message, "child_frame_id", ""))
                poses[record.topic].add(record.stamp, record.log_time, _pose(feed, record, name, message))
                continue
            if record.topic == TF_STATIC:
                _add_transforms(feed, name, record, fixed.add)
                continue
            if record.topic == topics.camera_info:
                if not infos:
                    infos.append(feed.decode(record.topic, record.data))
                continue
        except BadMessage as error:
            feed.drop("bad_message", str(error))
            continue
        records[record.topic].append(record._replace(data=b"", log_time=min(record.log_time, MAX_STAMP)))

    if odometry_in_transforms and not len(transforms[ODOMETRY_FRAMES]):
        topics = replace(topics, odometry=None)
        del transforms[ODOMETRY_FRAMES]
    for each in transforms.values():
        each.require(name, "truth" if each.name == topics.truth else "topics.odometry", feed.topics.get(each.topic, ""))
        base = each.child if each.name == topics.odometry else base
    image_topic = _image_topic(name, feed, topics, records)
    require_stamps(name, image_topic, "images", np.array([record.stamp for record in records[image_topic]], np.int64))
    odometry = _track(name, feed, "odometry", topics.odometry, poses, options.limits)
    truth = _track(name, feed, "truth", topics.truth, poses, options.limits)
    frames = _in_order(feed, name, image_topic, records[image_topic], "duplicate_frame")

    stamps, track = np.array([frame.stamp for frame in frames], dtype=np.int64), odometry or truth
    timed = [] if track is None else [frames[row] for row in np.flatnonzero(within(stamps, track.stamps))]
    width, height = _first_size(name, feed, timed or frames)
    view, camera_files = _camera(name, feed, options.camera, (width, height), files, infos)
    by_info = options.camera is None and "camera.yaml" not in feed.attachments and not camera_files
    mounted = fixed.mounted(
        view, base, _camera_frame(feed, frames[0], infos if by_info else ()) if fixed else "", by_info
    )
    view = mounted.camera
    if (width, height) != (view.width, view.height_px):
        hint = f"correct `image:` in {options.camera}" if options.camera else "give camera=PATH/camera.yaml"
        if width * view.height_px == height * view.width:
            hint = f"they are {width / view.width:.3g} times as large: the description is of another resolution; {hint}"
        raise UnreadableRecording(
            f"{name}: its images are {width} x {height}, but its camera says {view.width} x {view.height_px}; {hint}"
        )
    stamps = stamps - view.delay_ns  # also without a track: the truth may be in a file, and scans have times too
    keep = np.ones(len(frames), dtype=bool)
    if odometry is not None:
        keep = _seen_within(feed, name, "odometry", stamps, odometry.stamps, topics.odometry)
    elif truth is not None:
        keep = _seen_within(feed, name, "truth", stamps, truth.stamps, topics.truth)
    true = None
    if truth is not None:
        kind = "no_position" if odometry is None else "no_truth"
        apart = max_step_s(truth.stamps, 2.0 * options.truth_max_gap_s, 2.0)
        true = _true_poses(feed, f"{name}: {topics.truth}", stamps, keep, truth, apart, kind)
        keep &= (odometry is not None) | np.isfinite(true[:, 0])
        true = true[keep]
    frames, stamps = [frame for frame, kept in zip(frames, keep, strict=True) if kept], stamps[keep]
    recording = TopicRecording(
        name=name,
        camera=view,
        stamps=stamps,
        odometry=None if odometry is None else poses_at(odometry.stamps, odometry.poses, stamps),
        truth=true,
        unmeasured_s2=None if odometry is None else squares_within(odometry.gaps, stamps),
        feed=feed,
        images=frames,
        files=[*files, *camera_files],
        scans=_scans(name, feed, topics.scan, records),
        scanner=partial(fixed.scanner, base),
    )
    found = ""
    if odometry_in_transforms and odometry is not None:
        found = f"no Odometry is recorded: its transforms from {ODOMETRY_FRAMES.split(':')[1]} to {base} are taken"
    told = set_back(records[image_topic]) if len(files) == 1 else ""
    if odometry is not None and not told:
        told = camera_clock_set(_times(records[image_topic]), poses[str(topics.odometry)].times)
    several, unsaid = _cameras(feed, image_topic, frames[:FRAMES_ASKED]), mounted.unsaid(by_info)
    recording.mounted = mounted.in_words
    recording.assumed = tuple(f"{name}: {sentence}" for sentence in (found, told, several, unsaid) if sentence)
    return recording


def _odometry_in_transforms(feed: Feed, topics: Topics) -> bool:
    """Tells whether a log without any Odometry may hold it as transforms."""
    return (
        topics.odometry == Topics.odometry
        and not {topics.odometry, POSE_TYPES[0]} & {*feed.topics, *feed.topics.values()}
        and feed.topics.get(ODOMETRY_FRAMES.split(":")[0]) in TRANSFORMS_TYPES
    )


def _camera(
    name: str, feed: Feed, named: str | None, size: tuple[int, int], files: Sequence[Path], infos: Sequence[Any]
) -> tuple[Camera, list[Path]]:
    """The camera, and the files beside the recording that describe it."""
    beside = next((f for path in files for f in (path.parent / "camera.yaml",) if f.is_file()), None)
    if named is not None:
        return named_camera(named, lambda: size)
    if "camera.yaml" in feed.attachments:
        return parse_camera(feed.attachments["camera.yaml"], f"{name}: attachment camera.yaml"), []
    if beside is not None:
        return read_camera(beside), [beside]
    if infos:
        return camera_from_info(infos[0], f"{name}: camera_info"), []
    raise UnreadableRecording(
        f"{name}: nothing states how its images are to be read: no camera.yaml is attached or is beside it; "
        "give camera=PATH/camera.yaml"
    )


def _cameras(feed: Feed, topic: str, images: Sequence[Record]) -> str:
    """Sentence on images of several cameras on one topic, by their frames; else ""."""
    try:
        named = [message_of(feed, image).header.frame_id for image in images]
    except BadMessage:  # it is counted when it is read in its turn
        return ""
    found = list(dict.fromkeys(named))
    if len(found) < 2:
        return ""
    return (
        f"{topic} carries images of several cameras ({', '.join(map(shown, found))}): record each on a topic of its own"
    )


def _camera_frame(feed: Feed, image: Record, infos: Sequence[Any]) -> str:
    """The camera's frame, by its CameraInfo or else an image; empty where neither names it."""
    if infos and infos[0].header.frame_id:
        return str(infos[0].header.frame_id)
    try:
        return str(message_of(feed, image).header.frame_id)
    except BadMessage:
        return ""


def _add_transforms(feed: Feed, name: str, record: Record, *adds: Callable[[Any], None]) -> None:
    if feed.topics.get(record.topic) not in TRANSFORMS_TYPES:
        return  # where it is needed, that is reported once the log has been gone through
    message = feed.decode(record.topic, record.data)
    for add in adds:
        try:
            add(message)
        except (ValueError, AttributeError, TypeError) as error:  # a log may define the type otherwise
            feed.drop("bad_message", f"{name}: a message on {record.topic}: {error}")


def _pose(feed: Feed, record: Record, name: str, message: Any) -> tuple[float, float, float]:
    try:
        return pose_of(message)
    except AttributeError:
        kind = feed.topics.get(record.topic, "")
        raise UnreadableRecording(
            f"{name}: {record.topic} carries {kind}, which holds no pose (known: {', '.join(POSE_TYPES)})"
        ) from None
    except ValueError as error:
        kind = "impossible_pose" if isinstance(error, ImpossiblePose) else "bad_message"
        feed.drop(kind, f"{name}: a message on {record.topic}: {error}")
        return NOWHERE


def _image_topic(name: str, feed: Feed, topics: Topics, found: dict[str, list[Record]]) -> str:
    candidates = (topics.image,) if topics.image else IMAGE_TOPICS
    for topic in candidates:
        if found[topic]:
            if feed.topics[topic] not in IMAGE_TYPES:
                raise UnreadableRecording(
                    f"{name}: {topic} carries {feed.topics[topic]}, not images; {_known_image_topics(feed)}"
                )
            return topic
    empty = next((topic for topic in candidates if topic in feed.topics), None)
    if empty is not None:
        raise UnreadableRecording(f"{name}: there is no readable image on {empty} ({_losses(feed)})")
    raise UnreadableRecording(
        f"{name}: no topic {' or '.join(candidates)}; {_known_image_topics(feed, candidates[0])} "
        f"(topics: {', '.join(feed.topics) or 'none'})"
    )


def _losses(feed: Feed) -> str:
    return ", ".join(f"{count} {kind}" for kind, count in sorted(feed.dropped.items())) or "the topic is empty"


def _known_image_topics(feed: Feed, wanted: str = "") -> str:
    options = [topic for topic, kind in feed.topics.items() if kind in IMAGE_TYPES]
    if not options:
        return "it holds no images at all"
    return f"type topics.image={nearest(wanted, options) or options[0]}"


def _track(
    name: str, feed: Feed, role: str, topic: str | None, poses: dict[str, PoseTopic], limits: MotionLimits
) -> PoseTrack | None:
    """Stamps and poses of a pose topic in ascending order; None where the recording does not have it."""
    if topic is None:
        return None
    if poses[topic].topic not in feed.topics:
        default = next(field.default for field in fields(Topics) if field.name == role)
        kinds = POSE_TYPES if topic != default else POSE_TYPES[:1] if role == "odometry" else ()
        options = [other for other, kind in feed.topics.items() if kind in kinds]
        if not options and topic == default:
            return None
        hint = f"type topics.{role}={nearest(topic, options) or options[0]}, or " if options else "type "
        raise UnreadableRecording(
            f"{name}: no topic {topic}; {hint}topics.{role}=null to do without (topics: {', '.join(feed.topics)})"
        )
    return poses[topic].track(feed, name, limits, jumps=role == "truth")


def _scans(name: str, feed: Feed, topic: str | None, found: dict[str, list[Record]]) -> list[Record]:
    """Records of a topic of range readings in ascending order; none where the recording does not have it."""
    if topic is None or topic not in feed.topics:
        if topic not in (None, Topics.scan):
            raise UnreadableRecording(f"{name}: no topic {topic}; type topics.scan=null to do without it")
        return []
    if feed.topics[topic] != SCAN_TYPE:
        if topic == Topics.scan:  # nobody asked for it
            return []
        raise UnreadableRecording(
            f"{name}: {topic} carries {feed.topics[topic]}, not {SCAN_TYPE}; type topics.scan=null"
        )
    return _in_order(feed, name, topic, found[topic], "duplicate_stamp")


def _in_order(feed: Feed, name: str, topic: str, records: list[Record], repeats: str) -> list[Record]:
    times = _times(records)
    return [records[row] for row in in_order(feed, name, topic, times[:, 0], times[:, 1], repeats)]


def _times(records: list[Record]) -> Stamps:
    """Stamps and log times (N, 2), ns."""
    return np.array([(each.stamp, each.log_time) for each in records], np.int64).reshape(-1, 2)


def _seen_within(feed: Feed, name: str, role: str, stamps: Stamps, times: Stamps, topic: str | None) -> Bools:
    """Which images are in the time of a topic; the others are counted as lost. Raises `UnreadableRecording` if all."""
    keep, kind = within(stamps, times), {"odometry": "outside_odometry", "truth": "no_position"}[role]
    span = "from {:.3f} to {:.3f} s".format(*times[[0, -1]] / 1e9)
    for stamp in stamps[~keep]:
        feed.drop(kind, f"{name}: image at {stamp / 1e9:.3f} s, but {topic} is {span}")
    if not keep.any():
        images = "from {:.3f} to {:.3f} s".format(*stamps[[0, -1]] / 1e9)
        raise UnreadableRecording(
            f"{name}: no image can be used ({_losses(feed)}): images are {images}, {topic} is {span}; "
            f"record both by one clock, or type topics.{role}=null to do without"
        )
    return keep


def _true_poses(
    feed: Feed, where: str, stamps: Stamps, keep: Bools, truth: PoseTrack, max_s: float, kind: str
) -> Array:
    """True poses (N, 3) at images; NaN, and where they are to be kept counted as a `kind`, over silences and jumps."""
    poses, times = poses_at(truth.stamps, truth.poses, stamps), truth.stamps
    torn = np.append(silent(times, truth.poses, max_s) | np.isin(times[:-1], truth.gaps[:, 0]), False)
    unknown = torn[np.searchsorted(times, stamps) - 1] & ~np.isin(stamps, times)
    poses[unknown] = np.nan
    for stamp in stamps[unknown & keep]:
        feed.drop(kind, f"{where} jumps or is silent about the image at {stamp / 1e9:.3f} s")
    return poses


def _first_size(name: str, feed: Feed, images: Sequence[Record]) -> tuple[int, int]:
    """Width and height of the first of some images that can be decoded. Raises `UnreadableRecording`."""
    reason = ""
    for image in images:
        try:
            height, width = pixels_of(message_of(feed, image)).shape[:2]
        except (BadMessage, Undecodable) as error:
            reason = reason or f": {error}"
        else:
            return width, height
    raise UnreadableRecording(f"{name}: not one of its {len(images)} images can be decoded{reason}")
