"""Folders of images that nothing describes: in the order of their numbers, at a stated rate."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from omninav.pipeline import user_path

from .description import Description, Frames
from .image_folder import ImageFolder
from .recording import Format, OpenOptions

SUFFIXES = {".jpg": ".jpg", ".jpeg": ".jpg", ".tif": ".tif", ".tiff": ".tif"}
SUFFIXES |= {suffix: suffix for suffix in (".png", ".bmp", ".webp", ".ppm")}
"""Suffixes of images, in small letters, and the one that stands for their kind."""
DIGITS = re.compile(r"\d+")
"""Part of a name that differs within a series."""
CAMERA = re.compile(r"\D*(?:cam|camera|lens)[-_ ]?\d+(?=\D+\d)", re.IGNORECASE)
"""Beginning of a name that numbers a camera: another part differs within its series."""
MAX_SERIES = 4
"""Series of images that are named."""
WRAP_STEPS = 10.0
"""Number of usual steps between two images' numbers that is a gap, as where a camera begins again after 9999."""
DEFAULT_RATE_HZ = 1.0
"""Images per second where nobody states them: then most stages take every image."""


class UndescribedFolder(Format):
    """A folder with images and nothing else that tells of them. The last of the formats that open folders."""

    names = "a folder of images"

    def opens(self, log: str) -> bool:
        """A folder that holds images."""
        return bool(_kinds(user_path(log)))

    def open(self, log: str, options: OpenOptions) -> ImageFolder:
        """All images of the kind that most of them are of; others are counted. Raises `UnreadableRecording`."""
        folder = user_path(log)
        (kind, count), *others = _kinds(folder).most_common()
        rate = options.rate or DEFAULT_RATE_HZ
        description = Description(frames=Frames(images=_pattern(kind), period=1.0 / rate))
        recording = ImageFolder(log, folder, description, str(folder), options)
        for other, number in others:
            recording.drop("another_kind", f"{log}: {number} {other} beside {count} {kind}", number)
        series = Counter(_series(path.stem) for path in recording.paths)
        if len(series) > 1:
            names = ", ".join(f"{name} ({number})" for name, number in series.most_common(MAX_SERIES))
            told = (
                f"{log}: images of {len(series)} series, {names}, are taken for one drive, one series after the other"
            )
            recording.assumed = (*recording.assumed, told)
        elif wraps := _wrap([path.stem for path in recording.paths]):
            told = f"{log}: images are in the order of their numbers; did these begin again after {wraps}? Rename them"
            recording.assumed = (*recording.assumed, told)
        if options.rate is None:
            recording.assumed = (*recording.assumed, f"{log}: {rate:g} image per second (rate=… says otherwise)")
        return recording


def _series(name: str) -> str:
    numbered = CAMERA.match(name)
    end = numbered.end() if numbered else 0
    return name[:end] + DIGITS.sub("#", name[end:])


def _kinds(folder: Path) -> Counter[str]:
    """Number of images of each kind in a folder, in the order of their names."""
    if not folder.is_dir():
        return Counter()
    shown = (path.suffix.lower() for path in sorted(folder.iterdir()) if not path.name.startswith("."))
    return Counter(SUFFIXES[suffix] for suffix in shown if suffix in SUFFIXES)


def _wrap(names: Sequence[str]) -> str:
    """The last number (9999) of sorted names, where a camera may have begun again after it; else ''."""
    texts = [digits[-1] for name in names if (digits := DIGITS.findall(name))]
    if len(texts) < max(len(names), 3) or int(texts[0]) > 1 or set(texts[-1]) != {"9"}:
        return ""
    steps = np.diff([float(text) for text in texts])
    return texts[-1] if steps.max() > WRAP_STEPS * np.median(steps) else ""


def _pattern(kind: str) -> str:
    """The file names of a kind of images, in small letters or capitals: *.jpg also for *.JPEG."""
    letters = [f"[{letter}{letter.upper()}]" for letter in kind[1:]]
    return "*." + {".jpg": "{}{}*{}", ".tif": "{}{}{}*"}.get(kind, "{}" * len(letters)).format(*letters)
