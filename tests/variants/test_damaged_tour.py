"""A run says what the tour of its map lost."""

from pathlib import Path

import numpy as np
from conflicting_logs import IMAGE, changed_log
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.mcap.message import Message


def cut(message: Message, seconds: float) -> Message:
    """The first 20 s of images lack all but their first bytes."""
    if message.topic != IMAGE or seconds > 20.0:
        return message
    message.content.data = np.frombuffer(bytes(message.content.data)[:200], np.uint8)
    return message


def test_images_that_the_map_lacks_are_warned_of_once_made_and_from_the_cache(tmp_path: Path) -> None:
    tour = changed_log(TOUR, tmp_path / "tour.mcap", cut)
    for runs in ("made", "cached"):
        run = omninav.run(
            "omniview_mcl", tour=str(tour), log=str(DRIVE), runs=str(tmp_path / runs), cache=str(tmp_path / "cache"),
            plots="none", progress=False, **{"nodes.source.stop": 30},
        )  # fmt: skip
        dropped = run.manifest["dropped"]["source.undecodable_image (map)"]
        assert dropped["count"] == 20
        assert "undecodable image (map), 20 times" in (run.folder / "report.html").read_text()
