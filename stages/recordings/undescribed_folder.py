"""Folders of images that nothing describes: in the order of their numbers, at a stated rate."""

from collections import Counter
from pathlib import Path

from omninav.pipeline import user_path

from .description import Description, Frames
from .image_folder import ImageFolder
from .recording import Format, OpenOptions

SUFFIXES = (".jpg", ".jpeg", ".png", ".bmp", ".webp", ".tif", ".tiff", ".ppm")
DEFAULT_RATE_HZ = 1.0
"""Images per second where nobody states them: then most stages take every image."""


class UndescribedFolder(Format):
    """A folder with images and nothing else that tells of them. The last of the formats that open folders."""

    names = "a folder of images"

    def opens(self, log: str) -> bool:
        """A folder that holds images."""
        return bool(_suffixes(user_path(log)))

    def open(self, log: str, options: OpenOptions) -> ImageFolder:
        """All images of the kind that most of them are of. Raises `UnreadableRecording`."""
        folder = user_path(log)
        (suffix, _), *_ = _suffixes(folder).most_common(1)
        rate = options.rate or DEFAULT_RATE_HZ
        description = Description(frames=Frames(images=f"*{suffix}", period=1.0 / rate))
        recording = ImageFolder(log, folder, description, str(folder), options)
        if options.rate is None:
            recording.assumed = (*recording.assumed, f"{log}: {rate:g} image per second (rate=… says otherwise)")
        return recording


def _suffixes(folder: Path) -> Counter[str]:
    """Number of images of each kind in a folder, in the order of their names."""
    if not folder.is_dir():
        return Counter()
    shown = (path for path in sorted(folder.iterdir()) if not path.name.startswith("."))
    return Counter(path.suffix for path in shown if path.suffix.lower() in SUFFIXES)
