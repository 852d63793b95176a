"""Makes a camera.yaml of images of a checkerboard."""

import re
from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Tool, user_path, write_whole
from omninav.pipeline.report.plot_style import PALETTE, plot
from omninav.stages.camera.mirror_ring import RingNotFound, find_ring
from omninav.stages.camera.model import Ring
from omninav.stages.geometry.arrays import Array
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import UnreadableRecording
from omninav.stages.unwarp.checkerboard_calibration import BoardFit, Model, board_points, calibrated
from omninav.stages.values.image import Image, Pixels

from .camera_look import draw_panorama

MAX_SQUARES = 40
"""Inner corners of a board along one side."""
SAME_PX = 1.0
"""Images whose every corner is this near (pixels) to another image's show one view of the board."""


class CalibrateCamera(Tool):
    """Calibrates a mirror or a fisheye lens by images of a flat checkerboard, held all around the camera.

    Writes camera.yaml, and beside it a picture: the panorama that it gives, every corner's residual, and each image's.
    Height and yaw are not known from a board; the ring of the mirror is found in the image. Raises BadInput where the
    board is seen in fewer than three views, images are of several sizes, or no camera of that model explains them.
    """

    example = "images=FOLDER board=9x6"

    images: str
    """A folder of images, or a video (anything that `log` may be)."""
    board: str = "9x6"
    """Inner corners of the board, COLUMNSxROWS: one less than its squares along each side."""
    projection: Model = "ocamcalib"
    """`ocamcalib`: any mirror, by a polynomial; `hyperbolic`: a hyperbolic mirror; `fisheye`: an equidistant lens."""
    max_images: Annotated[int, Bounds(ge=3, le=500)] = 60
    """Number of a video's images that are looked at, evenly spread."""
    out: str = "camera.yaml"
    """The file to write."""

    def run(self, ctx: Context) -> None:
        """Find the board in every image, fit, and write."""
        path = user_path(self.out)
        if path.suffix not in (".yaml", ".yml"):
            raise BadInput(f"calibrate: out={self.out:.100} is no .yaml; type out=camera.yaml")
        picture = path.with_suffix(".png")
        if there := next((each for each in (path, picture) if each.exists()), None):
            raise BadInput(f"calibrate: {there} is there; type another name, or delete it")
        columns, rows = board_size(self.board)
        try:
            recording = open_recording(self.images, camera="perspective")  # of which no number is used
        except UnreadableRecording as error:  # it speaks of the setting of a run
            raise BadInput(re.sub(r"(^|type )log=", r"\1images=", str(error))) from None
        chosen = np.unique(np.linspace(0, len(recording.stamps) - 1, self.max_images).round().astype(int)).tolist()
        ctx.status("looking for the board in the images")
        seen: dict[int, Array] = {}
        copies: list[int] = []
        first: Pixels | None = None
        for done, frame in enumerate(chosen):
            ctx.progress(done, len(chosen))
            pixels = recording.image(frame)
            corners = None if pixels is None else find_corners(pixels, columns, rows)
            if corners is None:
                continue
            same = next((other for other in seen if np.abs(seen[other] - corners).max() < SAME_PX), None)
            if same is None:
                seen[frame] = corners
                first = pixels if first is None else first
            else:
                copies.append(frame)
                print(f"image {frame}: left out, it shows the board where image {same} does")
        if odd := recording.dropped["wrong_size"]:
            which = recording.details["wrong_size"].replace("the camera", "the first one")
            raise BadInput(
                f"calibrate: {odd} of {len(chosen)} images are of another size than the first one: {which}; "
                "give images of one size"
            )
        if first is None:
            raise BadInput(
                f"calibrate: no board of {columns} x {rows} inner corners is seen in any of {len(chosen)} images; "
                "count the corners between its squares: board=COLUMNSxROWS"
            )
        ctx.status("fitting the camera model")
        found = calibrated(
            self.projection, first.shape[1::-1], ring_of(first), list(seen.values()), board_points(columns, rows)
        )
        write_whole(path, write_camera(found.camera))
        write_whole(picture, draw_calibration(found, list(seen), list(seen.values()), first))
        for frame, rms in zip(seen, found.rms_px, strict=True):
            print(f"image {frame}: {rms:.2f} px")
        empty = [str(frame) for frame in chosen if frame not in seen and frame not in copies]
        print(
            f"{path}: {self.projection}, {np.sqrt(np.mean(found.rms_px**2)):.2f} px over {len(seen)} images"
            f"{'; no board in images ' if empty else ''}{', '.join(empty)}; look at {picture}"
        )


def board_size(board: str) -> tuple[int, int]:
    """Columns and rows of "9x6". Raises BadInput."""
    read = re.fullmatch(r"(\d{1,3})[x×](\d{1,3})", board.strip())
    size = (int(read[1]), int(read[2])) if read else (0, 0)
    if min(size) < 3 or max(size) > MAX_SQUARES:
        raise BadInput(f"calibrate: board={board:.40} is no COLUMNSxROWS from 3 to {MAX_SQUARES}; type board=9x6")
    return size


def find_corners(pixels: Pixels, columns: int, rows: int) -> Array | None:
    """Inner corners (columns x rows, 2) of a checkerboard in an image; None where there is none."""
    grey = cv2.cvtColor(pixels, cv2.COLOR_BGR2GRAY)
    there, corners = cv2.findChessboardCorners(grey, (columns, rows))
    if not there:
        return None
    spacing = np.linalg.norm(np.diff(corners.reshape(rows, columns, 2), axis=1), axis=2).min()
    window = max(2, int(spacing / 3))  # no other corner may be in it
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-3)
    refined = cv2.cornerSubPix(grey, corners, (window, window), (-1, -1), stop)
    return np.asarray(refined, np.float64).reshape(-1, 2)


def ring_of(pixels: Pixels) -> Ring:
    """A mirror's ring in an image, else the largest circle about its middle."""
    try:
        return find_ring(pixels)
    except RingNotFound:
        height, width = pixels.shape[:2]
        return Ring((width - 1) / 2, (height - 1) / 2, 0.0, min(width, height) / 2)


def draw_calibration(found: BoardFit, frames: list[int], corners: list[Array], pixels: Pixels) -> bytes:
    """A PNG: the panorama of an image, all corners with ten times their residuals, and each image's residual."""
    with plot(10.0, 8.0) as drawn:
        cells = drawn.canvas.add_gridspec(2, 2, width_ratios=[1.3, 1.0])
        draw_panorama(drawn.canvas.add_subplot(cells[0, :]), Image(pixels), found.camera)
        left, right = (drawn.canvas.add_subplot(cells[1, column]) for column in (0, 1))
        left.imshow(cv2.cvtColor(pixels, cv2.COLOR_BGR2RGB), alpha=0.45)
        for seen, off in zip(corners, found.residuals, strict=True):
            left.plot(*seen.T, ".", markersize=1.5, color=PALETTE[0])
            left.quiver(*seen.T, *off.T, angles="xy", scale_units="xy", scale=0.1, width=0.002, color=PALETTE[1])
        left.set_title("corners; arrows: ten times the residual")
        left.set_axis_off()
        right.barh([str(frame) for frame in frames], found.rms_px, color=PALETTE[0])
        right.set_xlabel("residual (px, root mean square)")
        right.set_ylabel("image")
        right.invert_yaxis()
    return drawn.content
