"""An image of where to go, from a file."""

import shlex
from pathlib import Path

from omninav.pipeline import BadInput, Context, Outputs, Stage, digest_file, nearest, read_small
from omninav.stages.camera.model import Camera
from omninav.stages.recordings.named_camera import named_camera
from omninav.stages.simulator.cameras import camera_of
from omninav.stages.simulator.config import WorldConfig
from omninav.stages.simulator.room_view import room_view
from omninav.stages.simulator.simulated_recording import simulation_digest
from omninav.stages.simulator.world_rooms import known_rooms
from omninav.stages.values.commands import GOAL_TOPIC
from omninav.stages.values.encoded_image import MAX_FILE_BYTES, Undecodable, decode_image
from omninav.stages.values.image import Image, Pixels

SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".ppm", ".tif", ".tiff", ".webp")
"""Endings of a goal that is an image file."""


class GoalImage(Stage):
    """Gives the goal's image, with the robot's own camera as the one that took it.

    Raises BadInput where no goal is named, where no place of the map can have its name (the map is still to be learned,
    or has no places), where there is no such file, where it is no image, and where it has another size than the robot's
    camera takes: before anything runs, as far as can be.
    """

    goal: str | int | None = None
    """An image file, by its suffix; any other names a place or, without `places`, a room whose image is taken.
    `/goal_pose`: none yet, a live robot waits to be sent."""
    world: WorldConfig | None = None
    """The simulated world whose robot took it; null: a real one's robot."""
    camera: str | None = None
    """The camera.yaml of a real robot or of another one in that world, or a projection (`equirectangular`, …)."""
    map: str | None = None
    """The saved map in which the goal is, if there is one; null: a map is learned first, and takes long."""
    tour: str | tuple[str, ...] | None = None
    """The log that the map is learned from; null: a drive through the world."""
    places: bool = True
    """Tells that the map has places; without, a name is a room of the simulated world, and its image is taken there."""

    class Out(Outputs):
        """Absent where the goal is a place of the map."""

        image: Image | None = None
        camera: Camera | None = None

    def inputs_digest(self) -> str | None:
        """Hashes the image, or the world in which it is taken; None for a place of the map."""
        file = self._file()
        if file is not None:
            return digest_file(file)
        return None if self.places or self.world is None else simulation_digest(self.world)

    def step(self, ctx: Context) -> Out:
        """Read the image, or take it."""
        file = self._file()
        if file is None:
            if self.places or self.world is None:
                return self.Out()
            return self.Out(image=Image(room_view(self.world, str(self.goal).strip())), camera=camera_of(self.world))
        pixels = read_image(file)
        if self.camera is None and self.world is None:
            raise BadInput(f"goal: nothing states what camera took {file}; give camera=PATH/camera.yaml")
        camera = self._camera(pixels)
        if pixels.shape[:2] != (camera.height_px, camera.width):
            raise BadInput(
                f"goal: {file} has {pixels.shape[1]} x {pixels.shape[0]} pixels, and the robot's camera takes "
                f"{camera.width} x {camera.height_px}; give an image that this camera took"
            )
        return self.Out(image=Image(pixels), camera=camera)

    def _camera(self, pixels: Pixels) -> Camera:
        if self.camera is None:
            return camera_of(self.world or WorldConfig())
        camera = named_camera(self.camera, lambda: pixels.shape[1::-1])[0].found_in(pixels)
        if camera is None:
            raise BadInput("goal: no ring of a mirror is found in the image; give centre and mask in a camera.yaml")
        return camera

    def _file(self) -> Path | None:
        if self.goal is None or not str(self.goal).strip():
            room = "goal=ROOM, or " if self._has_rooms() else ""
            place = "goal=PLACE, its name or number, or " if self.places else room
            wait = f", or goal={GOAL_TOPIC} to wait for one" if self.world is None else ""
            raise BadInput(f"goal: no goal is named; type {place}goal=IMAGE.png{wait}")
        if self.goal == GOAL_TOPIC:
            if self.world is not None:
                raise BadInput(f"goal: {GOAL_TOPIC} is for a live robot; in a simulated world type goal=IMAGE.png")
            return None
        if not str(self.goal).lower().endswith(SUFFIXES):
            if not self.places and not self._has_rooms():
                raise BadInput(
                    f"goal: {self.goal} is no image, and the map has no places; type goal=IMAGE.png, what the robot's "
                    "camera saw there"
                )
            self._refuse_unknown(str(self.goal).strip())
            return None
        file = Path(str(self.goal))
        if not file.is_file():
            other = (
                ", or a place's number or name" if self.places else ", or a room's name" if self._has_rooms() else ""
            )
            raise BadInput(f"goal: there is no file {file}; give an image{other}")
        return file

    def _has_rooms(self) -> bool:
        return self.world is not None and bool(known_rooms(None, self.world))

    def _refuse_unknown(self, name: str) -> None:
        """Raise BadInput for a name that no place of the map can have which is still to be learned."""
        numbered = self.places and name.isdecimal()
        if self.map is not None or numbered or (self.tour is None and self.world is None):
            return
        rooms = known_rooms(self.tour, self.world or WorldConfig())
        names = sorted({*rooms.names} - {""}) if rooms is not None else []
        if name not in names:
            known = f"its names are {', '.join(names)}" if names else "its places have no names"
            example = shlex.quote(f"goal={nearest(name, names) or names[0]}") if names else "goal=0"
            other = "a place's number" if self.places else "goal=IMAGE.png"
            raise BadInput(f"goal: the map will have no place '{name}'; type {example}, or {other} ({known})")


def read_image(file: Path) -> Pixels:
    """The pixels of an image file. Raises BadInput where it cannot be read as one."""
    try:
        return decode_image(read_small(file, MAX_FILE_BYTES))
    except Undecodable as error:
        raise BadInput(
            f"goal: {file} cannot be read as an image ({error}); give a .png or .jpg that the robot's camera took"
        ) from None
