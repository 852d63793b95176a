"""Writes the camera that a map's images showed as a file."""

from omninav.pipeline import Context, Stage, write_whole
from omninav.stages.values.maps import ReferenceGraph


class CameraFile(Stage):
    """Writes `camera.yaml` into the run's folder where the map's images show that the camera is not as described.

    `camera=FOLDER/camera.yaml` uses it.
    """

    def step(self, ctx: Context, map: ReferenceGraph) -> None:
        if map.landmarks is not None and map.landmarks.camera and ctx.folder is not None:
            write_whole(ctx.folder / "camera.yaml", map.landmarks.camera.encode())
