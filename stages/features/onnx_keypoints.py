"""A network of the user's own finds points and describes what they look like."""

import math
from typing import Annotated, Any, cast

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, cut
from omninav.stages.camera.equirectangular import camera_behind
from omninav.stages.camera.model import Camera, seen_at
from omninav.stages.camera.rays import unit_vectors
from omninav.stages.geometry.arrays import Array, Bytes, Floats
from omninav.stages.values.image import Image, Panorama, Pixels, column_azimuths
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.own_body import OwnBody

from .colour_moments import disc_colours
from .onnx_network import error_line, loaded, network_digest
from .prepared_image import PreparedImage, prepared_image
from .rotation_reduced_sift import COLOUR_RADIUS, SEAM, none_found

PARTS = {"scores": ("score",), "descriptors": ("desc", "feat"), "keypoints": ("keypoint", "kpt")}
"""Parts of an output's name that tell what it is."""
MULTIPLE = 32
"""Rows and columns of an image are filled up to a multiple of it, pixels: what networks halve up to five times."""
MIN_SIDE, MAX_SIDE = 4 * SEAM, 4096
"""Smallest and largest side of a network's images where its file states one, pixels."""
DIAMETER = 8.0
"""Diameter that a point is taken to have, pixels: networks tell none."""
MAX_LENGTH = 2048
"""Largest accepted descriptor, numbers."""
SHIFT = 2.0
"""Standard deviations within which angles between signed descriptors are kept exactly."""


def signed_as_bytes(descriptors: Floats) -> Bytes:
    """Descriptors (N, D) with signs as bytes (N, 2D) that compare like them once `root_descriptors` has taken roots.

    Each number x, in standard deviations of a row of length 1, becomes the squares of 2 + x and 2 - x, or 0 where these
    are negative: the products of their roots add up to a multiple of that of the rows, and a constant.
    """
    scaled = descriptors * (math.sqrt(descriptors.shape[1]) / np.linalg.norm(descriptors, axis=1, keepdims=True))
    squares = np.square(np.maximum(SHIFT + np.concatenate([scaled, -scaled], axis=1), 0.0))
    return np.asarray(np.rint(squares * (255.0 / squares.max(axis=1, keepdims=True))).astype(np.uint8), np.uint8)


class OnnxKeypoints(Stage):
    """Finds and describes points by a neural network (ONNX), as SuperPoint, DISK, ALIKED and XFeat are exported.

    The network is an ONNX file with its weights in it. Its input is one image (1, 1 or 3, rows, columns), grey or RGB
    in [0, 1]; its outputs are keypoints (N, 2) in pixels, column and row, their scores (N,) and descriptors (N, D) or
    (D, N), which names or shapes tell apart, each with or without a first axis of 1. Points with a score above 0 are
    kept. Such networks know upright images, and so a mirror's image is unwrapped for them; points are in the image as
    it came. It runs on the CPU in one thread, so that the same images give the same bytes. Needs onnxruntime
    (`pip install 'omninav[onnx]'`). Raises BadInput where the file is no such network.
    """

    model: str | None = None
    """The .onnx file; it has to be given."""
    max_features: Annotated[int, Bounds(ge=1)] = 500
    """The strongest are kept."""
    max_pixels: Annotated[int, Bounds(ge=1024)] = 153600
    """Larger images are made smaller, and further to what the network takes where its file states a size."""

    class Out(Outputs):
        """Points that were found, the strongest first; there may be none."""

        features: LocalFeatures

    def setup(self, ctx: Context) -> None:
        self._session = session = loaded(self.model)
        self._input, self._grey, self._sides = self._read_input(session)
        self._outputs = self._read_outputs(session)
        shape = next(each.shape for each in session.get_outputs() if each.name == self._outputs[2])
        self._columns = [isinstance(size, int) for size in shape[-2:]] == [True, False]  # one descriptor each
        self._camera: Camera | None = None

    def inputs_digest(self) -> str | None:
        """The digest of the network, and of the version that runs it."""
        return network_digest(self.model)

    def step(
        self, ctx: Context, image: Image | Panorama, camera: Camera | None = None, body: OwnBody | None = None
    ) -> Out:
        """Find the features of an image but for those of the robot's own `body`."""
        mirror = camera if isinstance(image, Image) and camera is not None and not camera.upright else None
        read, seam = self._prepared(image if mirror is None else self._unwrapped(image.pixels, mirror), camera)
        points, scores, descriptors = self._found(read.pixels, seam)
        edge = np.array([0.5 if read.circle else 0.0, 0.0])  # a circle's last column borders on its first
        inside = ((points >= -edge) & (points < np.array(read.seen.shape[::-1]) - 1 + edge + 1e-9)).all(axis=1)
        likely = np.flatnonzero(inside & (scores > 0) & (np.linalg.norm(descriptors, axis=1) > 0))
        likely = likely[np.lexsort((points[likely, 1], points[likely, 0], -scores[likely]))]
        originals = read.original(points[likely])
        bearings = read.bearings(originals)
        if mirror is not None:
            originals = seen_at(mirror, bearings)
            bearings = mirror.unproject(originals)[0]
        hidden = np.zeros(len(likely), np.bool_)
        if body is not None and body.found_in(image.pixels.shape[1], image.pixels.shape[0]):
            hidden = body.hides(originals)
        shown = np.flatnonzero(np.isfinite(bearings).all(axis=1) & ~hidden)[: self.max_features]
        kept, originals, bearings = likely[shown], originals[shown], bearings[shown]
        if not len(kept):
            return self.Out(features=none_found(2 * descriptors.shape[1]))
        sizes = np.full(len(kept), DIAMETER, np.float32)
        colours = disc_colours(read.pixels, read.seen, points[kept], COLOUR_RADIUS * sizes)
        sizes *= np.float32(read.scale.mean())
        return self.Out(features=LocalFeatures(bearings, originals, signed_as_bytes(descriptors[kept]), colours, sizes))

    def _unwrapped(self, pixels: Pixels, camera: Camera) -> Panorama:
        """The image of a mirror, or of lenses, as a panorama of square pixels."""
        if camera is not self._camera:
            top, bottom = self._edges = cast(tuple[float, float], camera.elevations)
            size = min(self.max_pixels, camera.width * camera.height_px)
            rows = math.sqrt(size * (top - bottom) / math.tau)
            elevations = top + (bottom - top) * (np.arange(int(rows)) + 0.5) / int(rows)
            seen = seen_at(camera, unit_vectors(column_azimuths(int(size / rows)), elevations[:, None]))
            self._u, self._v = np.nan_to_num(seen, nan=-10.0).transpose(2, 0, 1).astype(np.float32)
            self._camera = camera
        return Panorama(cast(Pixels, cv2.remap(pixels, self._u, self._v, cv2.INTER_LINEAR)), *self._edges)

    def _prepared(self, image: Image | Panorama, camera: Camera | None) -> tuple[PreparedImage, int]:
        """The image at the size that the network takes, and the columns that are repeated beyond both edges."""
        rows, columns = image.pixels.shape[:2]
        most, behind = self.max_pixels, camera_behind(image, camera)
        if self._sides is not None:
            circle = behind is not None and behind.wraps
            shrink = max(rows / self._sides[0], columns / (self._sides[1] - 2 * SEAM * circle))
            most = min(most, int(rows * columns / shrink**2))
        read = prepared_image(image, camera, most)
        return read, min(SEAM, read.pixels.shape[1]) if read.circle else 0

    def _found(self, pixels: Pixels, seam: int) -> tuple[Array, Floats, Floats]:
        """Points (N, 2) in these pixels, their scores (N,) and descriptors (N, D)."""
        rows, columns = pixels.shape[0], pixels.shape[1] + 2 * seam
        below, beside = (-rows % MULTIPLE, -columns % MULTIPLE)
        if self._sides is not None:
            below, beside = self._sides[0] - rows, self._sides[1] - columns
        wrapped = cv2.copyMakeBorder(pixels, 0, 0, seam, seam, cv2.BORDER_WRAP)
        filled = cv2.copyMakeBorder(wrapped, 0, below, 0, beside, cv2.BORDER_REPLICATE)
        coloured = cv2.cvtColor(filled, cv2.COLOR_BGR2GRAY if self._grey else cv2.COLOR_BGR2RGB)
        channels = coloured[None] if self._grey else coloured.transpose(2, 0, 1)
        given = np.ascontiguousarray(channels[None], np.float32) / np.float32(255.0)
        try:
            found = self._session.run(self._outputs, {self._input: given})
        except Exception as error:  # onnxruntime's errors are of no common class of its own
            shape = list(given.shape)
            raise BadInput(f"{self.model}: the network cannot run on an image {shape}: {error_line(error)}") from None
        points, scores, descriptors = self._checked(*(np.asarray(each) for each in found))
        return points - (seam, 0.0), scores, descriptors

    def _checked(self, points: Any, scores: Any, descriptors: Any) -> tuple[Array, Floats, Floats]:
        shapes = ", ".join(str(list(each.shape)) for each in (points, scores, descriptors))
        points, descriptors = (each[0] if each.ndim == 3 and len(each) == 1 else each for each in (points, descriptors))
        number = scores.size
        if descriptors.ndim == 2 and (len(descriptors) != number or (self._columns and descriptors.shape[1] == number)):
            descriptors = descriptors.T
        fits = points.shape == (number, 2) and descriptors.ndim == 2 and len(descriptors) == number
        numbers_alone = all(each.dtype.kind in "fiu" for each in (points, scores, descriptors))
        if not fits or not numbers_alone or not 1 <= descriptors.shape[1] <= MAX_LENGTH:
            raise BadInput(
                f"{self.model}: its outputs {cut(', '.join(self._outputs))} are {shapes}, expected keypoints [N, 2], "
                f"scores [N] and descriptors [N, D] of at most {MAX_LENGTH} numbers"
            )
        numbers = points.astype(np.float64), scores.reshape(-1).astype(np.float32), descriptors.astype(np.float32)
        if not all(np.isfinite(each).all() for each in numbers):
            raise BadInput(f"{self.model}: it gives keypoints, scores or descriptors that are not finite")
        return numbers

    def _read_input(self, session: Any) -> tuple[str, bool, tuple[int, int] | None]:
        """Name of the input, whether it is grey, and rows and columns of an image (None: any)."""
        inputs = session.get_inputs()
        sizes = [size if isinstance(size, int) and size > 0 else None for each in inputs for size in each.shape]
        batch, channels, rows, columns = sizes if len(sizes) == 4 else [0] * 4
        if batch not in (1, None) or channels not in (1, 3) or [each.type for each in inputs] != ["tensor(float)"]:
            shown = ", ".join(f"{list(each.shape)} of {each.type}" for each in inputs)
            raise BadInput(
                f"{self.model}: its input is {cut(shown)}, expected one image of float32: [1, 1 or 3, rows, columns]"
            )
        name = str(inputs[0].name)
        if rows is None or columns is None:
            return name, channels == 1, None
        if not MIN_SIDE <= min(rows, columns) <= max(rows, columns) <= MAX_SIDE:
            raise BadInput(
                f"{self.model}: its images are {rows} x {columns}, expected {MIN_SIDE} to {MAX_SIDE} pixels a side"
            )
        return name, channels == 1, (rows, columns)

    def _read_outputs(self, session: Any) -> list[str]:
        """Names of the keypoints, the scores and the descriptors."""
        outputs: Any = session.get_outputs()
        told: dict[str, str] = {}
        for output in outputs:
            of = (part for part, words in PARTS.items() if any(word in output.name.lower() for word in words))
            told.setdefault(next(of, ""), output.name)
        pairs = [output.name for output in outputs if output.shape and output.shape[-1] == 2]
        others = sorted((len(output.shape), output.name) for output in outputs if output.name not in pairs)
        if not told.keys() >= PARTS.keys() and len(pairs) == 1 and len(others) == 2 and others[0][0] < others[1][0]:
            told = {"keypoints": pairs[0], "scores": others[0][1], "descriptors": others[1][1]}
        if not told.keys() >= PARTS.keys():
            shown = ", ".join(f"{output.name} {list(output.shape)}" for output in outputs)
            raise BadInput(
                f"{self.model}: its outputs are {cut(shown)}, expected keypoints [N, 2], scores [N] and "
                "descriptors [N, D], so named or of these shapes"
            )
        return [told["keypoints"], told["scores"], told["descriptors"]]
