"""Encodes frames as a video that browsers play: MP4 with VP9 where OpenCV can write it, else an animated GIF."""

import io
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import cv2

from omninav.stages.values.image import Pixels

from .snapshot_times import spread_out


class Video(NamedTuple):
    """A video's bytes and what they are: `video/mp4` or `image/gif`."""

    content: bytes
    media_type: str

    @property
    def suffix(self) -> str:
        """Of its file's name, with the dot."""
        return f".{self.media_type.partition('/')[2]}"


def encoded(frames: Sequence[Pixels], per_second: float) -> Video:
    """Frames (rows, columns, 3), blue-green-red, all of one even size, as a video: the same bytes every time.

    Every frame is drawn once for an MP4 and once for a GIF: `frames` may draw them when asked.
    """
    return mp4(frames, per_second) or gif(frames, per_second)


def mp4(frames: Sequence[Pixels], per_second: float) -> Video | None:
    """VP9 in MP4, which all browsers play, from libvpx as OpenCV's wheels have it; None where this OpenCV has not."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "video.mp4"
        level = cv2.utils.logging.getLogLevel()
        cv2.utils.logging.setLogLevel(0)  # else OpenCV prints that there is no such codec
        try:
            rows, columns = frames[0].shape[:2]
            writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"vp09"), per_second, (columns, rows))
            for frame in frames if writer.isOpened() else ():
                writer.write(frame)
            writer.release()
        finally:
            cv2.utils.logging.setLogLevel(level)
        return Video(path.read_bytes(), "video/mp4") if path.exists() and path.stat().st_size else None


def gif(frames: Sequence[Pixels], per_second: float) -> Video:
    """An animated GIF in 128 colours, those of a few of its frames."""
    from PIL import Image as PillowImage  # comes with matplotlib

    images = [PillowImage.fromarray(frame[:, :, ::-1]) for frame in frames]
    few = [images[n] for n in spread_out(len(images), 6)]
    all_of_them = PillowImage.new("RGB", (few[0].width, len(few) * few[0].height))
    for number, image in enumerate(few):
        all_of_them.paste(image, (0, number * image.height))
    palette = all_of_them.quantize(128)
    small = [image.quantize(palette=palette, dither=PillowImage.Dither.NONE) for image in images]
    buffer = io.BytesIO()
    rest = {"save_all": True, "append_images": small[1:], "duration": round(1000 / per_second), "loop": 0}
    small[0].save(buffer, format="GIF", optimize=False, **rest)
    return Video(buffer.getvalue(), "image/gif")
