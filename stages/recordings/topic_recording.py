"""A recording whose frames are messages on topics, whatever file they are in."""

import hashlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from omninav.pipeline import digest_file
from omninav.pipeline.mcap.message import BadMessage, Record
from omninav.stages.camera.model import Camera
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.image import Pixels
from omninav.stages.values.scan import Scan

from .messages import pixels_of, scan_of
from .placed_scan import placed_scan
from .recording import DecodeAhead, Recording, UnreadableRecording, checked_image
from .stamps import Stamps, ascending, lone

STALE = 1_000_000_000
"""Nanoseconds after which range readings are outdated."""
UNSTAMPED = 0.9
"""Share of a topic's messages with one stamp in common from which on its driver counts as one that sets none."""


class Feed(Protocol):
    """A file (or several) of stamped messages, gone through once and then read where needed."""

    @property
    def topics(self) -> dict[str, str]: ...
    @property
    def attachments(self) -> dict[str, bytes]: ...
    @property
    def dropped(self) -> Counter[str]: ...
    @property
    def details(self) -> dict[str, str]: ...
    def scan(self, topics: Collection[str] | None = None) -> Iterator[Record]: ...
    def fetch(self, location: Any) -> bytes | memoryview: ...
    def decode(self, topic: str, data: bytes | memoryview) -> Any: ...
    def drop(self, kind: str, detail: str) -> None: ...


def message_of(feed: Feed, record: Record) -> Any:
    """A message that was found by a scan, read again. Raises `BadMessage`."""
    return feed.decode(record.topic, feed.fetch(record.location))


def in_order(
    feed: Feed, name: str, topic: str, stamps: Stamps, log_times: Stamps, repeats: str = "duplicate_stamp"
) -> Stamps:
    """Which of a topic's messages to keep so that their stamps ascend, in that order: (K,). The others are counted.

    `repeats`: what a repeated stamp is counted as.
    """
    order = np.argsort(log_times, kind="stable")
    stamps = stamps[order]
    kept = np.arange(len(stamps))
    if (np.diff(stamps) <= 0).any():
        chosen, repeated, backward = ascending(stamps.tolist())
        for number in repeated:
            feed.drop(repeats, f"{name}: {topic} repeats the stamp {stamps[number]} ns")
        for number in backward:
            feed.drop("backward_stamp", f"{name}: {topic} has a stamp out of order, {stamps[number]} ns")
        kept = np.array(chosen, np.int64)
    apart = lone(stamps[kept])
    for stamp in stamps[kept[apart]]:
        feed.drop("lone_stamp", f"{name}: {topic} has a stamp hours from all others, {stamp} ns")
    return order[kept[~apart]]


def require_stamps(name: str, topic: str, what: str, stamps: Stamps, cure: str = "") -> None:
    """Raise `UnreadableRecording` where nearly all of a topic's messages have one stamp."""
    values, counts = np.unique(stamps, return_counts=True)
    if len(stamps) > 1 and (most := counts.max()) >= UNSTAMPED * len(stamps):
        at = f"{values[counts.argmax()] / 1e9:.3f} s"
        raise UnreadableRecording(
            f"{name}: {topic}: {most:,} of its {len(stamps):,} {what} are stamped {at} "
            "(the driver sets no header stamp), and log times are no substitute; "
            f"record with a driver that stamps them{cure}"
        )


class TopicRecording(Recording):
    """Frames from an image topic with poses from pose topics. Images are read when asked for."""

    def __init__(
        self,
        name: str,
        camera: Camera,
        stamps: Stamps,
        odometry: Array | None,
        truth: Array | None,
        feed: Feed,
        images: Sequence[Record],
        files: Sequence[Path],
        scans: Sequence[Record] = (),
        unmeasured_s2: Array | None = None,
        scanner: Callable[[str], Array | None] = lambda frame: None,
    ) -> None:
        self.unmeasured_s2 = unmeasured_s2
        self.mounted = ""
        """Position of its camera by `/tf_static`, in words; empty where that is not new."""
        self.name, self.camera, self.stamps, self.odometry, self.truth = name, camera, stamps, odometry, truth
        self._images = DecodeAhead(lambda frame: partial(pixels_of, message_of(feed, images[frame])))
        self._feed, self._files, self._scans, self._scanner = feed, files, scans, scanner
        self._scan_stamps = np.array([record.stamp for record in scans], dtype=np.int64)

    @property
    def dropped(self) -> Counter[str]:  # type: ignore[override]  # the feed counts, of all its files
        """Skipped data, by kind."""
        return self._feed.dropped

    @property
    def details(self) -> dict[str, str]:  # type: ignore[override]  # likewise
        """The first case of each kind."""
        return self._feed.details

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels | None:
        """The image of a frame; None (and counted) where it cannot be decoded, is blank or of another size."""
        where = f"{self.name}: image {frame} (stamp {self.stamps[frame] / 1e9:.3f} s)"
        return checked_image(partial(self._images.image, frame, following), where, self.camera, self._feed.drop)

    def scan(self, frame: int) -> Scan | None:
        """The last ring of ranges before a frame, read now; None where the last second has none, or a broken one."""
        number = int(np.searchsorted(self._scan_stamps, self.stamps[frame], side="right")) - 1
        if number < 0 or self.stamps[frame] - self._scan_stamps[number] > STALE:
            return None
        record = self._scans[number]
        try:
            message = message_of(self._feed, record)
            return placed_scan(scan_of(message), self._scanner(message.header.frame_id))
        except BadMessage as error:
            self._feed.drop("bad_message", str(error))
        except ValueError as error:
            self._feed.drop("bad_message", f"{self.name}: a message on {record.topic}: {error}")
        return None

    def digest(self) -> str:
        """sha256 over the bytes of all files that were read."""
        whole = hashlib.sha256()
        for path in self._files:
            whole.update(digest_file(path).encode())
        return whole.hexdigest()
