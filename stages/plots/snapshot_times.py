"""Frames of snapshots, of drives whose length is not known while they last."""

FRAMES = 60
"""Snapshots that are shown of a drive at most."""


def is_snapshot_frame(frame: int) -> bool:
    """Every frame below 2 x `FRAMES`, every second one below 4 x `FRAMES`, every fourth below 8 x `FRAMES`, and so on.

    So there are always enough at even steps, and few beside them.
    """
    return frame % max(1, 1 << (frame // FRAMES).bit_length() >> 1) == 0


def even_frames(frames: int) -> range:
    """At most `FRAMES` of a number of frames at even steps from the first on, all of them snapshot frames."""
    step = 1
    while frames > FRAMES * step:
        step *= 2
    return range(0, frames, step)
