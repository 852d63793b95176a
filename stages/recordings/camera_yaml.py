"""`camera.yaml`: how a camera's pictures are to be read, as a file.

projection: hyperbolic | donut | cylindrical | equirectangular | fisheye | perspective
image: {width: 640, height: 480}
K: [[fx, skew, cx], [0, fy, cy], [0, 0, 1]]           hyperbolic, perspective; fisheye (or focal_px and centre)
mirror: {a: 28.095, b: 23.4125, unit: mm}             hyperbolic
mask: {inner_radius_px: 34, outer_radius_px: 238}     hyperbolic, fisheye; donut: optional
centre: {x: 319.5, y: 239.5}                          donut: optional
focal_px: 300                                         fisheye: pixels per radian
column_of_forward: 360                                cylindrical, equirectangular
elevation: {top: 0.5, bottom: -0.5}                   equirectangular; cylindrical: optional (radians)
sense: clockwise | counter_clockwise                  all but hyperbolic and perspective
height: 0.9                                           metres, optional
yaw: 0.3                                              radians, optional
"""

from collections.abc import Callable, Mapping
from typing import Any, Literal, cast

import yaml

from omninav.pipeline.graph.problems import nearest
from omninav.stages.camera.models import (
    Camera,
    Cylindrical,
    Donut,
    Equirectangular,
    Fisheye,
    HyperbolicMirror,
    Perspective,
    Sense,
)

from .recording import UnreadableRecording


def parse_camera(text: str | bytes, where: str) -> Camera:
    """The camera that a file describes. Raises `UnreadableRecording` naming `where` and the key that is wrong."""
    try:
        content = yaml.safe_load(text)
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise UnreadableRecording(f"{where}: not readable as YAML ({' '.join(str(error).split())})") from None
    return camera_from(content, where)


def camera_from(content: Any, where: str, size: tuple[int, int] | None = None) -> Camera:
    """The camera of an already loaded description; `size` (width, height) where the description leaves it out."""
    section = _Section(content, where)
    if size is not None and isinstance(content, dict) and "image" not in content:
        section = _Section({**content, "image": {"width": size[0], "height": size[1]}}, where)
    projection = section.text("projection", tuple(_READERS))
    camera = _READERS[projection](section)
    section.misspelt()
    return camera


def write_camera(camera: Camera) -> str:
    """The text of a `camera.yaml` that reads back as the same camera."""
    return yaml.safe_dump(_WRITERS[type(camera)](camera), sort_keys=False)


def camera_from_info(info: Any, where: str) -> Camera:
    """A camera from a CameraInfo message, where there is no camera.yaml.

    `distortion_model: hyperbolic_mirror` has d = [a, b]; nothing is said of mask, height and yaw: the whole circle that
    fits the picture is used, and yaw is 0. Undistorted perspective cameras are read as such.
    Raises `UnreadableRecording` for any other model.
    """
    k = [float(number) for number in (info.k if hasattr(info, "k") else info.K)]
    d = [float(number) for number in (info.d if hasattr(info, "d") else info.D)]
    width, height = int(info.width), int(info.height)
    if k[0] <= 0 or k[4] <= 0:
        raise UnreadableRecording(
            f"{where}: its focal length is {k[0]:g}: not calibrated; give camera=PATH/camera.yaml"
        )
    if info.distortion_model == "hyperbolic_mirror" and len(d) >= 2:
        outer = min(k[2], width - 1 - k[2], k[5], height - 1 - k[5])
        return HyperbolicMirror(
            width=width,
            height_px=height,
            focal_x=k[0],
            focal_y=k[4],
            centre_x=k[2],
            centre_y=k[5],
            skew=k[1],
            a=d[0],
            b=d[1],
            inner_radius_px=0.0,
            outer_radius_px=outer,
        )
    if info.distortion_model in ("", "plumb_bob", "rational_polynomial") and not any(d):
        return Perspective(
            width=width, height_px=height, focal_x=k[0], focal_y=k[4], centre_x=k[2], centre_y=k[5], skew=k[1]
        )
    raise UnreadableRecording(
        f"{where}: distortion model '{info.distortion_model}' does not describe an omnidirectional camera; "
        "give camera=PATH/camera.yaml"
    )


class _Section:
    """A mapping in a file, read key by key; what is wrong names the file and the key."""

    def __init__(self, content: Any, where: str, path: str = "") -> None:
        if not isinstance(content, dict):
            what = f"'{path.rstrip('.')}' must hold keys" if path else "must hold keys (projection: …)"
            raise UnreadableRecording(f"{where}: {what}")
        self.content, self.where, self.path = content, where, path
        self.read: set[str] = set()

    def raw(self, key: str) -> Any:
        self.read.add(key)
        if self.content.get(key) is None:
            near = nearest(key, [str(name) for name in self.content if name not in self.read])
            hint = f"; did you mean it by '{self.path}{near}'?" if near else ""
            raise UnreadableRecording(f"{self.where}: key '{self.path}{key}' is missing{hint}")
        return self.content[key]

    def has(self, key: str) -> bool:
        self.read.add(key)
        return self.content.get(key) is not None

    def number(self, key: str) -> float:
        value = self.raw(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise UnreadableRecording(f"{self.where}: '{self.path}{key}' must be a number, not {value!r}")
        return float(value)

    def optional(self, key: str) -> float | None:
        return self.number(key) if self.has(key) else None

    def positive(self, key: str) -> float:
        value = self.number(key)
        if value <= 0:
            raise UnreadableRecording(f"{self.where}: '{self.path}{key}' must be above 0, not {value:g}")
        return value

    def text(self, key: str, options: tuple[str, ...]) -> str:
        value = self.raw(key)
        if value not in options:
            near = nearest(str(value), options)
            hint = f"; did you mean '{near}'?" if near else f"; one of {', '.join(options)}"
            raise UnreadableRecording(f"{self.where}: '{self.path}{key}' cannot be {value!r}{hint}")
        return str(value)

    def section(self, key: str) -> "_Section":
        return _Section(self.raw(key), self.where, f"{self.path}{key}.")

    def misspelt(self) -> None:
        """Refuse keys that look like an optional one that is not there; other unknown keys are remarks."""
        for key in self.content:
            near = nearest(str(key), sorted(self.read - set(self.content))) if key not in self.read else None
            if near:
                raise UnreadableRecording(f"{self.where}: key '{self.path}{key}' is not known; did you mean '{near}'?")

    def size(self) -> dict[str, Any]:
        image = self.section("image")
        return {"width": int(image.positive("width")), "height_px": int(image.positive("height"))}

    def pinhole(self) -> dict[str, Any]:
        rows = self.raw("K")
        try:
            flat = [float(number) for row in rows for number in (row if isinstance(row, list) else [row])]
        except (TypeError, ValueError):
            flat = []
        if len(flat) != 9 or flat[0] <= 0 or flat[4] <= 0:
            raise UnreadableRecording(
                f"{self.where}: '{self.path}K' must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], "
                "with focal lengths above 0"
            )
        names = ("focal_x", "skew", "centre_x", None, "focal_y", "centre_y")
        return {name: number for name, number in zip(names, flat, strict=False) if name}

    def sense(self) -> Sense:
        options = ("clockwise", "counter_clockwise")
        return (
            cast(Literal["clockwise", "counter_clockwise"], self.text("sense", options))
            if self.has("sense")
            else "clockwise"
        )

    def yaw(self) -> float:
        return self.optional("yaw") or 0.0


def _hyperbolic(section: _Section) -> Camera:
    mirror, mask = section.section("mirror"), section.section("mask")
    camera = HyperbolicMirror(
        **section.size(),
        **section.pinhole(),
        a=mirror.positive("a"),
        b=mirror.positive("b"),
        inner_radius_px=mask.number("inner_radius_px"),
        outer_radius_px=mask.positive("outer_radius_px"),
        height=section.optional("height"),
        yaw=section.yaw(),
    )
    if camera.inner_radius_px >= camera.outer_radius_px:
        raise UnreadableRecording(f"{section.where}: 'mask.inner_radius_px' must be below 'mask.outer_radius_px'")
    return camera


def _donut(section: _Section) -> Camera:
    centre = section.section("centre") if section.has("centre") else None
    mask = section.section("mask") if section.has("mask") else None
    return Donut(
        **section.size(),
        centre_x=centre.number("x") if centre else None,
        centre_y=centre.number("y") if centre else None,
        inner_radius_px=mask.number("inner_radius_px") if mask else None,
        outer_radius_px=mask.positive("outer_radius_px") if mask else None,
        sense=section.sense(),
        yaw=section.yaw(),
    )


def _cylindrical(section: _Section) -> Camera:
    elevation = section.section("elevation") if section.has("elevation") else None
    return Cylindrical(
        **section.size(),
        column_of_forward=section.number("column_of_forward"),
        sense=section.sense(),
        height=section.optional("height"),
        elevation_top=elevation.number("top") if elevation else None,
        elevation_bottom=elevation.number("bottom") if elevation else None,
    )


def _equirectangular(section: _Section) -> Camera:
    elevation = section.section("elevation")
    return Equirectangular(
        **section.size(),
        column_of_forward=section.number("column_of_forward"),
        elevation_top=elevation.number("top"),
        elevation_bottom=elevation.number("bottom"),
        sense=section.sense(),
        height=section.optional("height"),
    )


def _fisheye(section: _Section) -> Camera:
    mask = section.section("mask")
    if section.has("K"):
        k = section.pinhole()
        lens = {"focal_px": k["focal_x"], "centre_x": k["centre_x"], "centre_y": k["centre_y"]}
    else:
        centre = section.section("centre")
        lens = {
            "focal_px": section.positive("focal_px"),
            "centre_x": centre.number("x"),
            "centre_y": centre.number("y"),
        }
    return Fisheye(
        **section.size(),
        **lens,
        outer_radius_px=mask.positive("outer_radius_px"),
        inner_radius_px=mask.optional("inner_radius_px") or 0.0,
        sense=section.sense(),
        height=section.optional("height"),
        yaw=section.yaw(),
    )


def _perspective(section: _Section) -> Camera:
    return Perspective(**section.size(), **section.pinhole(), height=section.optional("height"), yaw=section.yaw())


_READERS: Mapping[str, Callable[[_Section], Camera]] = {
    "hyperbolic": _hyperbolic,
    "donut": _donut,
    "cylindrical": _cylindrical,
    "equirectangular": _equirectangular,
    "fisheye": _fisheye,
    "perspective": _perspective,
}


def _head(projection: str, camera: Camera) -> dict[str, Any]:
    return {"projection": projection, "image": {"width": camera.width, "height": camera.height_px}}


def _pinhole(camera: HyperbolicMirror | Perspective) -> list[list[float]]:
    return [
        [camera.focal_x, camera.skew, camera.centre_x],
        [0.0, camera.focal_y, camera.centre_y],
        [0.0, 0.0, 1.0],
    ]


def _known(**values: Any) -> dict[str, Any]:
    """The entries that have a value; of the sections among them, those that hold one."""
    kept = {key: _known(**value) if isinstance(value, dict) else value for key, value in values.items()}
    return {key: value for key, value in kept.items() if value is not None and value != {}}


def _write_hyperbolic(camera: HyperbolicMirror) -> dict[str, Any]:
    return _head("hyperbolic", camera) | _known(
        K=_pinhole(camera),
        mirror={"a": camera.a, "b": camera.b, "unit": "mm"},
        mask={"inner_radius_px": camera.inner_radius_px, "outer_radius_px": camera.outer_radius_px},
        height=camera.height,
        yaw=camera.yaw,
    )


def _write_donut(camera: Donut) -> dict[str, Any]:
    return _head("donut", camera) | _known(
        centre={"x": camera.centre_x, "y": camera.centre_y},
        mask={"inner_radius_px": camera.inner_radius_px, "outer_radius_px": camera.outer_radius_px},
        sense=camera.sense,
        yaw=camera.yaw,
    )


def _write_strip(camera: Cylindrical | Equirectangular) -> dict[str, Any]:
    return _head("cylindrical" if isinstance(camera, Cylindrical) else "equirectangular", camera) | _known(
        column_of_forward=camera.column_of_forward,
        elevation={"top": camera.elevation_top, "bottom": camera.elevation_bottom},
        sense=camera.sense,
        height=camera.height,
    )


def _write_fisheye(camera: Fisheye) -> dict[str, Any]:
    return _head("fisheye", camera) | _known(
        focal_px=camera.focal_px,
        centre={"x": camera.centre_x, "y": camera.centre_y},
        mask={"inner_radius_px": camera.inner_radius_px, "outer_radius_px": camera.outer_radius_px},
        sense=camera.sense,
        height=camera.height,
        yaw=camera.yaw,
    )


def _write_perspective(camera: Perspective) -> dict[str, Any]:
    return _head("perspective", camera) | _known(K=_pinhole(camera), height=camera.height, yaw=camera.yaw)


_WRITERS: Mapping[type[Camera], Callable[[Any], dict[str, Any]]] = {
    HyperbolicMirror: _write_hyperbolic,
    Donut: _write_donut,
    Cylindrical: _write_strip,
    Equirectangular: _write_strip,
    Fisheye: _write_fisheye,
    Perspective: _write_perspective,
}
