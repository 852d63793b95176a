"""Images decoded before they are asked for."""

import threading

import numpy as np
import pytest

from omninav.stages.recordings.recording import AHEAD, DecodeAhead
from omninav.stages.values.encoded_image import Undecodable


class Decoder:
    """A made-up file: image n is n everywhere, image 3 is damaged, 5 gone; it knows what it was asked for and where."""

    def __init__(self) -> None:
        self.fetched: list[int] = []
        self.decoded: dict[int, str] = {}

    def __call__(self, frame):
        self.fetched.append(frame)
        if frame == 5:
            raise OSError("gone")

        def decode():
            self.decoded[frame] = threading.current_thread().name
            if frame == 3:
                raise Undecodable("image 3")
            return np.full((2, 2, 3), frame, np.uint8)

        return decode


def test_expected_images_are_the_same_and_are_read_once():
    decoder = Decoder()
    images = DecodeAhead(decoder)
    for frame in (0, 1, 2):
        assert (images.image(frame, [frame + 1, frame + 2]) == frame).all()
    assert sorted(decoder.fetched) == [0, 1, 2, 3, 4]
    assert decoder.decoded[0] == threading.current_thread().name
    assert decoder.decoded[1].startswith("decode")


def test_an_image_that_is_damaged_or_cannot_be_read_raises_when_it_is_asked_for():
    images = DecodeAhead(Decoder())
    assert (images.image(2, [3, 4]) == 2).all()
    with pytest.raises(Undecodable, match="image 3"):
        images.image(3, [4, 5])
    assert (images.image(4, [5, 6]) == 4).all()
    with pytest.raises(OSError, match="gone"):
        images.image(5, [6])
    assert (images.image(6) == 6).all()


def test_only_a_few_images_are_decoded_ahead():
    decoder = Decoder()
    DecodeAhead(decoder).image(10, range(11, 30))
    assert len(decoder.fetched) == 1 + AHEAD
