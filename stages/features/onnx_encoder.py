"""A network of the user's own describes the view."""

import itertools
import math
from typing import Annotated, Any, Literal

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, cut
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.encoded_image import MAX_PIXELS
from omninav.stages.values.features import SegmentDescriptors
from omninav.stages.values.image import Panorama, Pixels

from .onnx_network import error_line, loaded, network_digest
from .segment_edges import segment_edges

PerChannel = tuple[float, float, float]
MAX_SIDE = 4096
Side = Annotated[int, Bounds(ge=1, le=MAX_SIDE)]

MAX_MAGNITUDE = 1e15
"""Largest accepted number of a vector."""
MAX_NUMBERS = 1 << 20
"""Largest accepted vector of an image, numbers."""
IMAGENET_MEAN, IMAGENET_DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
"""Red, green, blue, of pixels in [0, 1]: what most networks for images were trained with."""


def encoder_input(
    pixels: Pixels, segments: int, size: tuple[int, int], channels: str, mean: PerChannel, deviation: PerChannel
) -> Floats:
    """Equal parts of a panorama as a network takes them: (segments, rows, columns, 3) float32.

    `size`: rows and columns; each part is averaged or interpolated to it. `mean`, `deviation`: of `channels` in their
    own order, of pixels in [0, 1].
    """
    edges = segment_edges(pixels.shape[1], segments)
    parts = []
    for first, end in itertools.pairwise(edges.tolist()):
        shrinks = pixels.shape[0] >= size[0] and end - first >= size[1]
        way = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
        parts.append(cv2.resize(pixels[:, first:end], (size[1], size[0]), interpolation=way))
    taken = np.stack(parts)[..., ::-1] if channels == "rgb" else np.stack(parts)
    scaled = (taken.astype(np.float32) / np.float32(255) - np.array(mean, np.float32)) / np.array(deviation, np.float32)
    return np.ascontiguousarray(scaled, np.float32)


class OnnxEncoder(Stage):
    """Describes each part of a panorama by the output vector of a neural network (ONNX), scaled to length 1.

    The network is an ONNX file with its weights in it, one input of four dimensions (images) and an output of one
    vector for each image. It runs on the CPU in one thread, so that the same images give the same bytes. Needs
    onnxruntime (`pip install 'omninav[onnx]'`). Raises BadInput where the file is no such network.
    """

    model: str | None = None
    """The .onnx file; it has to be given."""
    segments: Annotated[int, Bounds(ge=1)] = 8
    """Equal parts of the panorama, each an image of its own for the network. With 1 the whole panorama is one image,
    and views show nothing of the robot's heading."""
    size: tuple[Side, Side] | None = None
    """Rows and columns of the network's images; null: as its file states."""
    layout: Literal["nchw", "nhwc"] = "nchw"
    """Order of the input's dimensions: image, channel, row, column, as PyTorch writes them; or channels last."""
    channels: Literal["rgb", "bgr"] = "rgb"
    """Order of the colours."""
    mean: PerChannel = IMAGENET_MEAN
    """Subtracted from pixels in [0, 1], by channel; by default ImageNet's. For a network that takes 0 to 255:
    mean=[0,0,0] deviation=[0.00392157,0.00392157,0.00392157]."""
    deviation: tuple[Annotated[float, Bounds(gt=0)], Annotated[float, Bounds(gt=0)], Annotated[float, Bounds(gt=0)]] = (
        IMAGENET_DEVIATION
    )
    """By which the rest is divided."""
    output: str | None = None
    """Name of the output that is the descriptor; null: the first."""

    class Out(Outputs):
        features: SegmentDescriptors

    def setup(self, ctx: Context) -> None:
        self._session = session = loaded(self.model)
        self._input, self._size, self._batch = self._read_input(session)
        names = [output.name for output in session.get_outputs()]
        if self.output is not None and self.output not in names:
            known = cut(", ".join(names))
            raise BadInput(f"{self.model}: there is no output '{self.output}'; its outputs are: {known}")
        self._output = self.output or names[0]

    def inputs_digest(self) -> str | None:
        """Digest of the network and of the version that runs it."""
        return network_digest(self.model)

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        images = encoder_input(panorama.pixels, self.segments, self._size, self.channels, self.mean, self.deviation)
        if self.layout == "nchw":
            images = np.ascontiguousarray(images.transpose(0, 3, 1, 2))
        step = self._batch or len(images)
        vectors = np.concatenate([self._encoded(images[n : n + step]) for n in range(0, len(images), step)])
        return self.Out(features=SegmentDescriptors.of(vectors))

    def _encoded(self, images: Floats) -> Floats:
        try:
            given = np.asarray(self._session.run([self._output], {self._input: images})[0])
        except Exception as error:  # onnxruntime's errors are of no common class of its own
            shape = f"{list(images.shape)} ({self.layout})"
            raise BadInput(f"{self.model}: the network cannot run on images {shape}: {error_line(error)}") from None
        if given.ndim < 2 or len(given) != len(images) or given.dtype.kind != "f" or not given.size:
            raise BadInput(
                f"{self.model}: its output {cut(self._output)} is {list(given.shape)} of {given.dtype} for "
                f"{len(images)} images, expected one vector of floating-point numbers for each; name another: "
                "nodes.features.output=NAME"
            )
        if given.size > MAX_NUMBERS * len(images):
            raise BadInput(
                f"{self.model}: its vectors have {given[0].size:,} numbers, at most {MAX_NUMBERS:,} are read"
            )
        with np.errstate(over="ignore"):
            vectors = given.reshape(len(images), -1).astype(np.float32)
        if not np.abs(vectors).max() <= MAX_MAGNITUDE:  # NaN too
            raise BadInput(f"{self.model}: it gives vectors that are not finite, or larger than {MAX_MAGNITUDE:g}")
        return vectors

    def _read_input(self, session: Any) -> tuple[str, tuple[int, int], int | None]:
        """Name of the input, rows and columns of an image, and how many images at once (None: any number)."""
        first, *more = session.get_inputs()
        sizes = [size if isinstance(size, int) and size > 0 else None for size in first.shape]
        order = (0, 2, 3, 1) if self.layout == "nchw" else (0, 1, 2, 3)
        batch, rows, columns, channels = [sizes[n] for n in order] if len(sizes) == 4 else [0] * 4
        if more or first.type != "tensor(float)" or channels not in (3, None):
            raise BadInput(
                f"{self.model}: its input is {cut(first.shape)} of {first.type}, expected one of float32 with four "
                f"dimensions and three channels ({self.layout}); for channels last write nodes.features.layout=nhwc"
            )
        own = None if rows is None or columns is None else (rows, columns)
        size = own or self.size
        if size is None:
            raise BadInput(f"{self.model}: it states no size of its images; write nodes.features.size=[224,224]")
        if max(size) > MAX_SIDE or self.segments * math.prod(size) > MAX_PIXELS:
            raise BadInput(
                f"{self.model}: {self.segments} images of {size[0]} x {size[1]} are too large, expected {MAX_SIDE} "
                f"a side and {MAX_PIXELS:,} pixels in all; write fewer nodes.features.segments"
            )
        if self.size not in (None, size):
            raise BadInput(f"{self.model}: its images are {size[0]} x {size[1]}; leave nodes.features.size out")
        if batch is not None and self.segments % batch:
            raise BadInput(
                f"{self.model}: it takes {batch} images at once; write nodes.features.segments={batch} or a multiple"
            )
        return first.name, size, batch
