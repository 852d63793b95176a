import pytest

from omninav.stages.plots.frame_by_frame import shown_frames


@pytest.mark.parametrize(
    ("shown", "frames", "words"),
    [
        (range(4), 4, "Every frame is shown."),
        (range(0, 103, 2), 103, "Every second frame is shown."),
        (range(0, 103, 4), 103, "Every 4th frame is shown."),
        ([0, 2, 8], 9, "3 of 9 frames can be stepped to."),
    ],
)
def test_a_caption_says_which_frames_can_be_stepped_to(shown, frames, words):
    assert shown_frames(list(shown), frames) == words
