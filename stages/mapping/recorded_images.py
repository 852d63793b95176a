"""Keeps the images of a drive as they were taken, for a program that is given files."""

from collections.abc import Sequence

import cv2
import numpy as np

from omninav.pipeline import Context, Outputs, Stage, Tick, Value
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.recorded_images import RecordedImages
from omninav.stages.values.drive import pose_rows
from omninav.stages.values.image import Image
from omninav.stages.values.pose import Pose

COMPRESSION = 1
"""Level of PNG, 0 to 9: the fastest that makes an image smaller."""


class EncodedImage(Value):
    """The bytes of an image's PNG file."""

    bulky = True
    png: bytes


class EncodeImage(Stage):
    """Encodes each image as PNG, without loss."""

    class Out(Outputs):
        encoded: EncodedImage

    def step(self, ctx: Context, image: Image) -> Out:
        _, png = cv2.imencode(".png", image.pixels, [cv2.IMWRITE_PNG_COMPRESSION, COMPRESSION])
        return self.Out(encoded=EncodedImage(png.tobytes()))


class CollectImages(Stage):
    """Collects the images of a drive, with their times and what is known of where they were taken."""

    class Out(Outputs):
        """All of them; absent where there is none."""

        images: RecordedImages | None = None

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        encoded: Sequence[EncodedImage],
        camera: Camera,
        odometry: Sequence[Pose | None],
        truth: Sequence[Pose | None],
    ) -> Out:
        pngs = [each.png for each in encoded]
        if not pngs:
            return self.Out()
        return self.Out(
            images=RecordedImages(
                camera=write_camera(camera),
                pngs=np.frombuffer(b"".join(pngs), np.uint8),
                ends=np.cumsum([0, *map(len, pngs)], dtype=np.int64),
                stamps=np.array([tick.stamp for tick in ticks], np.int64),
                odometry=pose_rows(list(odometry)),
                truth=pose_rows(list(truth)),
            )
        )
