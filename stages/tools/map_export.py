"""Writes a map's images as the folder that image-to-image navigators take for a map, or its landmarks as points."""

import math
import os
import shutil
from pathlib import Path
from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Tool, named, user_path, write_whole
from omninav.pipeline.engine.artifact import read_artifact
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.map_files.point_cloud import ply
from omninav.stages.map_files.saved import SavedMap, read_saved
from omninav.stages.values.encoded_image import Undecodable
from omninav.stages.values.image import Pixels
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.thumbnails import Thumbnails

BESIDE = "thumbnails.omap"
"""File in which the run that learned a map leaves its images."""


class ExportMap(Tool):
    """Writes the images of a map's references or views as `0.png`, `1.png`, … into a new folder, or its landmarks.

    Images are in the order of the tour: the topological map of ViNT, NoMaD and GNM (`deployment/topomaps/images/NAME`)
    and of PlaceNav (`placenav/topomaps/images/NAME`), which know one path without branches. Landmarks are a point cloud
    that CloudCompare, MeshLab and Open3D read: x, y (m) in the map's frame, z (m) above the camera. Raises BadInput
    where the map's images are missing or another map's, the folder holds something, or the map has no landmarks.
    """

    example = "runs/latest/map.omap spacing=1 out=topomap"

    maps: str | tuple[str, ...]
    """The map (.omap)."""
    images: str | None = None
    """The images of its references (.omap); null: `thumbnails.omap` beside the map."""
    spacing: Annotated[float, Bounds(ge=0, le=1e6)] = 0.0
    """Smallest distance (m) between where two images that follow each other were taken."""
    field_deg: Annotated[float, Bounds(gt=0, le=360)] | None = None
    """Degrees around straight ahead that are cut out of panoramas; null: whole images."""
    out: str = "topomap"
    """The folder to write its images to, or the file (.ply) for its landmarks."""

    def run(self, ctx: Context) -> None:
        (source,) = read_saved(self.maps, at_most=1)
        if self.out.endswith(".ply"):
            return self._export_points(source)
        folder = self._folder()
        file, thumbnails = self._thumbnails(source)
        map = source.map
        panoramas = isinstance(map, ReferenceGraph) and map.features.shape[1] > 1
        if self.field_deg is not None and not panoramas:
            raise BadInput(f"field_deg={self.field_deg:g}: the images of {source.path} are no panoramas; leave it out")
        order = np.arange(len(map)) if isinstance(map, ReferenceGraph) else np.argsort(map.frames, kind="stable")
        there = order[np.diff(thumbnails.ends)[order] > 0]
        kept = there[spaced(map.poses[there], self.spacing)]
        if not len(kept):
            raise BadInput(f"{source.path}: it has no image to write")
        part = folder.with_name(f"{folder.name}.{os.getpid()}.part")
        part.mkdir(parents=True)
        try:
            for number, row in enumerate(kept.tolist()):
                try:
                    image = thumbnails.image(row)
                except Undecodable as error:
                    raise BadInput(f"{file}: image {row} cannot be decoded: {error}") from None
                encoded = cv2.imencode(".png", self._cut(image))[1]
                with named(folder, part):
                    (part / f"{number}.png").write_bytes(encoded.tobytes())
            os.replace(part, folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
        missing = f"; {len(order) - len(there)} have none" if len(there) < len(order) else ""
        print(f"{folder}: images of {len(kept)} of {len(order)} views, 0.png to {len(kept) - 1}.png{missing}")

    def _export_points(self, source: SavedMap) -> None:
        landmarks = source.map.landmarks if isinstance(source.map, ReferenceGraph) else None
        if landmarks is None or not len(landmarks):
            raise BadInput(f"{source.path}: it has no landmarks to write; type landmarks=sift where a map is made")
        path = user_path(self.out)
        write_whole(path, ply(landmarks.points))
        print(f"{path}: {len(landmarks)} landmarks")

    def _folder(self) -> Path:
        folder = user_path(self.out)
        if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
            raise BadInput(f"out={self.out}: it is there, and not an empty folder; type another name")
        return folder

    def _thumbnails(self, source: SavedMap) -> tuple[Path, Thumbnails]:
        file = source.path.with_name(BESIDE) if self.images is None else user_path(self.images)
        if self.images is None and not file.exists():
            raise BadInput(
                f"{source.path}: a map holds no images, and there is no {BESIDE} beside it; export the map in the "
                f"folder of a run with tour=… and log=…, or type images=FOLDER/{BESIDE}"
            )
        images = read_artifact(file)
        if not isinstance(images, Thumbnails):
            raise BadInput(f"{file}: it holds a {type(images).__name__}, expected images of a map ({BESIDE})")
        views = len(source.map) if isinstance(source.map, ReferenceGraph) else len(source.map.views)
        if len(images) != views:
            raise BadInput(f"{file}: it has {len(images)} images, {source.path} has {views} views: another map's")
        return file, images

    def _cut(self, pixels: Pixels) -> Pixels:
        if self.field_deg is None:
            return pixels
        columns = pixels.shape[1]
        wide = max(1, round(columns * self.field_deg / 360.0))
        left = (columns - wide) // 2  # forward is in the middle
        return pixels[:, left : left + wide]


def spaced(poses: Array, spacing: float) -> Ints:
    """Rows of poses (N, >= 2) of which each is at least `spacing` metres from the one before it that is kept."""
    kept: list[int] = []
    for row, (x, y) in enumerate(poses[:, :2].tolist()):
        if not kept or math.dist(poses[kept[-1], :2], (x, y)) >= spacing:
            kept.append(row)
    return np.array(kept, np.int64)
