"""ROS messages as what they mean here: poses in the plane, and images."""

import math
from typing import Any

import cv2
import numpy as np

from omninav.stages.geometry.arrays import Bytes
from omninav.stages.values.encoded_image import Undecodable, decode_image
from omninav.stages.values.image import Pixels
from omninav.stages.values.scan import Scan

POSE_TYPES = (
    "nav_msgs/msg/Odometry",
    "geometry_msgs/msg/PoseStamped",
    "geometry_msgs/msg/PoseWithCovarianceStamped",
    "geometry_msgs/msg/TransformStamped",
)
TRANSFORMS_TYPE = "tf2_msgs/msg/TFMessage"
TRANSFORMS_TYPES = (TRANSFORMS_TYPE, "tf/msg/tfMessage")  # the second in bags of before 2014
SCAN_TYPE = "sensor_msgs/msg/LaserScan"
IMAGE_TYPES = ("sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image")
MAX_COORDINATE_M = 1e8
"""Twice the way around the Earth: no map projection puts anything further away."""
MIN_SCAN_STEP = 1e-4
"""Smallest angle between two ranges of a scan, radians: below that of any scanner."""
LEVELS_OF_A_BLANK = 2
"""A constant image may differ by this much after JPEG compression (rounding of one level to either side)."""
ALIGNMENTS = (4, 8, 16, 32, 64, 128)
"""Numbers of bytes to a multiple of which a driver may fill up the rows of a raw image."""

_AS_BGR = {
    "bgr8": (3, None),
    "8UC3": (3, None),
    "rgb8": (3, cv2.COLOR_RGB2BGR),
    "bgra8": (4, cv2.COLOR_BGRA2BGR),
    "rgba8": (4, cv2.COLOR_RGBA2BGR),
    "mono8": (1, cv2.COLOR_GRAY2BGR),
    "8UC1": (1, cv2.COLOR_GRAY2BGR),
    "yuv422": (2, cv2.COLOR_YUV2BGR_UYVY),
    "uyvy": (2, cv2.COLOR_YUV2BGR_UYVY),
    "yuv422_yuy2": (2, cv2.COLOR_YUV2BGR_YUY2),
    "yuyv": (2, cv2.COLOR_YUV2BGR_YUY2),
    # OpenCV names a Bayer pattern by the second row's second and third pixel, ROS by the first row's first two
    "bayer_rggb8": (1, cv2.COLOR_BayerBG2BGR),
    "bayer_bggr8": (1, cv2.COLOR_BayerRG2BGR),
    "bayer_gbrg8": (1, cv2.COLOR_BayerGR2BGR),
    "bayer_grbg8": (1, cv2.COLOR_BayerGB2BGR),
}


class ImpossiblePose(ValueError):
    """A pose that nothing on Earth has; the message states why."""


def pose_of(message: Any) -> tuple[float, float, float]:
    """x, y (m) and heading (rad) of an Odometry, PoseStamped, PoseWithCovarianceStamped or TransformStamped message.

    Raises ValueError where they are not finite numbers, `ImpossiblePose` where they are nowhere on Earth or the
    quaternion's length is far from 1.
    """
    if hasattr(message, "transform"):
        position, q = message.transform.translation, message.transform.rotation
    else:
        pose = message.pose
        pose = getattr(pose, "pose", pose)
        position, q = pose.position, pose.orientation
    length = math.hypot(q.x, q.y, q.z, q.w)
    if not math.isfinite(position.x + position.y + length):
        raise ValueError("its pose is not finite")
    if math.hypot(position.x, position.y) > MAX_COORDINATE_M:
        raise ImpossiblePose(f"{math.hypot(position.x, position.y):.1e} m from its origin: further than the Earth is")
    if not 0.5 <= length <= 2.0:
        raise ImpossiblePose(f"its orientation is a quaternion of length {length:.2g}, not 1")
    heading = math.atan2(2 * (q.w * q.z + q.x * q.y), q.w * q.w + q.x * q.x - q.y * q.y - q.z * q.z)
    return float(position.x), float(position.y), heading


def scan_of(message: Any) -> Scan:
    """A LaserScan message as a `Scan`: what is no number, or out of its bounds, is no echo.

    Raises ValueError for fewer than two ranges, and for angles and bounds that no scanner has.
    """
    ranges = np.asarray(message.ranges, dtype=np.float64)
    first, step = float(message.angle_min), float(message.angle_increment)
    if len(ranges) < 2 or not math.isfinite(first) or not MIN_SCAN_STEP <= abs(step) <= 2.0 * math.pi:
        raise ValueError(f"{len(ranges)} ranges from {first:g} in steps of {step:g} rad are no scan")
    if not 0.0 <= message.range_min <= message.range_max <= MAX_COORDINATE_M:
        raise ValueError(f"its ranges go from {message.range_min:g} to {message.range_max:g} m")
    heard = np.isfinite(ranges) & (ranges >= message.range_min) & (ranges <= message.range_max)
    return Scan(
        ranges=np.where(heard, ranges, np.inf),
        first=first,
        step=step,
        nearest=float(message.range_min),
        farthest=float(message.range_max),
    )


def scan_fields(scan: Scan) -> dict[str, Any]:
    """The fields of the LaserScan message that `scan_of` makes the scan of; its header is left out."""
    return {
        "angle_min": scan.first,
        "angle_max": scan.first + scan.step * (len(scan.ranges) - 1),
        "angle_increment": scan.step,
        "range_min": scan.nearest,
        "range_max": scan.farthest,
        "ranges": scan.ranges.astype(np.float32),
    }


def pixels_of(message: Any) -> Pixels:
    """The image of an Image or CompressedImage message, (height, width, 3) uint8 blue-green-red.

    Raises `Undecodable`.
    """
    return decode_image(bytes(message.data)) if hasattr(message, "format") else _raw_pixels(message)


def is_blank(pixels: Pixels) -> bool:
    """Tells whether an image is constant: no channel spans more than `LEVELS_OF_A_BLANK` grey levels."""
    some = (pixels[::step, ::step] for step in (64, 8, 1))  # a few pixels tell most images from a blank
    return not any(np.ptp(part, axis=(0, 1)).max() > LEVELS_OF_A_BLANK for part in some)


def _raw_pixels(message: Any) -> Pixels:
    if message.encoding not in _AS_BGR:
        raise Undecodable(f"encoding '{message.encoding}' is not known (known: {', '.join(_AS_BGR)})")
    channels, conversion = _AS_BGR[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    data: Bytes = np.frombuffer(bytes(message.data), np.uint8)
    if channels == 2 and width % 2:
        raise Undecodable(f"{width} pixels a row, expected an even number of {message.encoding}")
    if 0 < step < width * channels:
        raise Undecodable(f"its step of {step} bytes is too short for {width} pixels of {message.encoding}")
    if width < 1 or height < 1 or step < 1 or data.size < height * step:
        raise Undecodable(f"{data.size} bytes for {width} x {height} pixels of {message.encoding}")
    padded = {-(-width * channels // bytes_) * bytes_ for bytes_ in ALIGNMENTS}
    if step % width == 0 and step // width in {1, 2, 3, 4} - {channels} and step not in padded:
        raise Undecodable(f"rows hold {step // width} bytes a pixel, its encoding {message.encoding} has {channels}")
    rows = data[: height * step].reshape(height, step)[:, : width * channels]
    raw = np.ascontiguousarray(rows).reshape((height, width, channels) if channels > 1 else (height, width))
    return np.asarray(raw if conversion is None else cv2.cvtColor(raw, conversion), dtype=np.uint8)
