"""`camera.yaml`: how a camera's images are to be read, as a file.

`projection:` names the model; the other keys are what the model's class declares (`stages/camera/`): some at the top
(height, yaw, delay, sense), some in a section (image, mirror, mask, centre, elevation), and the matrix
K: [[fx, skew, cx], [0, fy, cy], [0, 0, 1]].
"""

import dataclasses
from pathlib import Path
from typing import Annotated, Any, get_args, get_origin

import numpy as np
import yaml

from omninav.pipeline import (
    BadInput,
    Parameter,
    convert,
    nearest,
    offered,
    parse_yaml,
    read_parameters,
    read_yaml,
    shown,
)
from omninav.stages.camera.model import Camera, Key, camera_models, require_sight

from .recording import UnreadableRecording

Keys = dict[str, set[str]]
OTHER_SIZE = 1.5
"""Ratio of an image's centre to half its sides above which it is of another resolution."""
SAME_SIDES = 0.1
"""Relative difference up to which the ratios of columns and rows agree."""
UNITS = {"height": ", in metres above the floor", "yaw": ", in radians", "delay": ", in seconds"}
"""Units of keys that are often given in others, for messages."""
MATRIX = "must be [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], with focal lengths of a pixel or more"


def read_camera(path: Path) -> Camera:
    """The camera that a file describes. Raises `BadInput` naming the file, and the line or key that is wrong.

    A file that can be mended holds no key that no camera has; what is attached to a log may hold remarks.
    """
    content = read_yaml(path)
    camera = camera_from(content, str(path))
    keys = {key for model in camera_models().values() for key in _known_keys(model)[""]}
    if unknown := sorted(map(str, content.keys() - keys)):
        own = ", ".join(sorted(_known_keys(type(camera))[""]))
        raise UnreadableRecording(f"{path}: key '{unknown[0]:.40}' is not known; keys: {own}; remarks begin with #")
    return camera


def parse_camera(text: str | bytes, where: str) -> Camera:
    """The camera that a text describes. Raises `BadInput` naming `where`, and the line or key that is wrong."""
    return camera_from(parse_yaml(text, where), where)


def camera_from(content: Any, where: str, size: tuple[int, int] | None = None) -> Camera:
    """The camera of an already loaded description; `size` (width, height) where the description leaves it out."""
    if not isinstance(content, dict):
        raise UnreadableRecording(f"{where}: must hold keys (projection: …)")
    if size is not None and "image" not in content:
        content = {**content, "image": {"width": size[0], "height": size[1]}}
    model = _model(content, where)
    known = _known_keys(model)
    found = {name: _value(content, parameter, known, where) for name, parameter in read_parameters(model).items()}
    _refuse_misspelt(content, known, where)
    try:
        camera = model(**{name: value for name, value in found.items() if value is not None})
        _require_own_centre(camera)
        require_sight(camera)
    except (ValueError, BadInput) as error:
        raise UnreadableRecording(f"{where}: {error}") from None
    return camera


def write_camera(camera: Camera) -> str:
    """The text of a `camera.yaml` that reads back as the same camera."""
    return yaml.safe_dump(camera_section(camera), sort_keys=False)


def camera_section(camera: Camera) -> dict[str, Any]:
    """Content of a `camera.yaml`."""
    content: dict[str, Any] = {"projection": camera.projection}
    for name, parameter in read_parameters(type(camera)).items():
        value, key = getattr(camera, name), keys_of(parameter)[0]
        value = list(value) if isinstance(value, tuple) else value
        if value is None:
            continue
        if isinstance(key.name, int):
            matrix = content.setdefault(key.section, [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
            matrix[key.name // 3][key.name % 3] = value
        else:
            (content.setdefault(key.section, {}) if key.section else content)[key.name] = value
    return content


UNSAID_BY_INFO = (
    "neither CameraInfo nor /tf_static states where the camera sits: yaw and position are 0 "
    "(else give camera=PATH/camera.yaml)"
)
"""Sentence on a camera that a CameraInfo message alone describes."""


def camera_from_info(info: Any, where: str) -> Camera:
    """A camera from a CameraInfo message, where there is no camera.yaml, by the first model that knows its distortion.

    It holds nothing of mask, height and yaw. Raises `UnreadableRecording` where no model knows it.
    """
    k = [float(number) for number in (info.k if hasattr(info, "k") else info.K)]
    d = [float(number) for number in (info.d if hasattr(info, "d") else info.D)]
    if not np.isfinite([*k, *d]).all() or len(k) != 9 or k[0] <= 0 or k[4] <= 0:
        raise UnreadableRecording(
            f"{where}: its focal length is {k[0]:g}: not calibrated; give camera=PATH/camera.yaml"
        )
    for model in camera_models().values():
        try:
            camera = model.from_camera_info(info.distortion_model, (int(info.width), int(info.height)), k, d)
        except ValueError as error:
            raise UnreadableRecording(f"{where}: {error}") from None
        if camera is not None:
            return camera_from(camera_section(camera), where)  # within the limits of a camera.yaml
    raise UnreadableRecording(
        f"{where}: distortion model '{info.distortion_model}' does not describe an omnidirectional camera; "
        "give camera=PATH/camera.yaml"
    )


def keys_of(parameter: Parameter) -> list[Key]:
    """Places in camera.yaml that may hold a parameter of a camera."""
    found = [extra for extra in _annotations(parameter.type) if isinstance(extra, Key)]
    return found or [Key("", parameter.name)]


def _annotations(kind: Any) -> list[Any]:
    """Annotations of a type, or of a part of it (`Annotated[float, …] | None`)."""
    arguments = get_args(kind)
    if get_origin(kind) is Annotated:
        return list(arguments[1:])
    return [extra for argument in arguments if get_args(argument) for extra in _annotations(argument)]


def _require_own_centre(camera: Camera) -> None:
    """Raise ValueError where the image's centre is that of another resolution, or its coordinates are exchanged."""
    x, y = getattr(camera, "centre_x", None), getattr(camera, "centre_y", None)
    if x is None or y is None:
        return
    width, height = camera.width, camera.height_px
    scale, sides = x / width + y / height, width / height
    found = f"the centre ({x:g}, {y:g}) of an image of {width} x {height}"
    same = abs(x / width - y / height) < SAME_SIDES * scale
    if same and not 1.0 / OTHER_SIZE < scale < OTHER_SIZE:
        raise ValueError(
            f"{found} is that of one {scale:.2g} times as large; give centre and focal lengths of its size"
        )
    exchanged = max(abs(2.0 * x / height - 1.0), abs(2.0 * y / width - 1.0)) < SAME_SIDES
    if exchanged and not 1.0 - 2.0 * SAME_SIDES < sides < 1.0 + 2.0 * SAME_SIDES:
        raise ValueError(f"{found} has its column and row exchanged: expected ({y:g}, {x:g})")


def _model(content: dict[str, Any], where: str) -> type[Camera]:
    models, name = camera_models(), content.get("projection")
    if name is None:
        raise UnreadableRecording(f"{where}: {_missing(content, Key('', 'projection'), {'': {'projection'}})}")
    if not isinstance(name, str) or name not in models:
        near = nearest(name, models, 0.7) if isinstance(name, str) else None
        hint = f"did you mean '{near}'? " if near else ""
        hint += f"one of {', '.join(sorted(models))}; a model of your own is named in OMNINAV_STAGES, or installed"
        broken = "".join(f"; {entry.name}: {entry.problem}" for entry in offered("camera") if entry.problem)
        raise UnreadableRecording(f"{where}: 'projection' cannot be {shown(name)}; {hint}{broken}")
    return models[name]


def _value(content: dict[str, Any], parameter: Parameter, known: Keys, where: str) -> Any:
    """A parameter's value; None where it is left out and may be."""
    for key in keys_of(parameter):
        path = f"{key.section}.{key.name}".strip(".")
        section: Any = content.get(key.section) if key.section else content
        if section is None:
            continue
        if isinstance(key.name, int):
            value: Any = _matrix(section, where)[key.name]
            path = key.section
        elif not isinstance(section, dict):
            raise UnreadableRecording(f"{where}: '{key.section}' must hold keys")
        else:
            value = section.get(key.name)
        if value is None:
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, dict | list):
                expected = "hold numbers" if isinstance(value, list) else "be a number or a word"
                raise UnreadableRecording(f"{where}: '{path}' must {expected}, not {shown(part)}")
        converted, problems = convert(value, parameter.type, path)
        if problems:
            what = f" {MATRIX}" if isinstance(key.name, int) else f": {problems[0].what}{UNITS.get(path, '')}"
            raise UnreadableRecording(f"{where}: '{path}'{what}")
        return converted
    if parameter.default is dataclasses.MISSING:
        raise UnreadableRecording(f"{where}: {_missing(content, keys_of(parameter)[0], known)}")
    return None


def _matrix(rows: Any, where: str) -> list[float]:
    try:
        flat = [float(number) for row in rows for number in (row if isinstance(row, list) else [row])]
    except (TypeError, ValueError):
        flat = []
    if len(flat) != 9 or [flat[3], *flat[6:]] != [0.0, 0.0, 0.0, 1.0]:
        raise UnreadableRecording(f"{where}: 'K' {MATRIX}")
    return flat


def _known_keys(model: type[Camera]) -> Keys:
    """Keys that a camera.yaml of this model may hold, by section."""
    keys = [key for parameter in read_parameters(model).values() for key in keys_of(parameter)]
    known: Keys = {"": {"projection"} | {key.section for key in keys if key.section}}
    for key in keys:
        known.setdefault(key.section, set()).add(str(key.name))
    return known


def _missing(content: dict[str, Any], key: Key, known: Keys) -> str:
    """Message about a key that is missing, or whose section is."""
    if key.section and content.get(key.section) is None:
        key = Key("", key.section)
    part, prefix = (content[key.section], f"{key.section}.") if key.section else (content, "")
    near = nearest(str(key.name), [str(name) for name in part if name not in known[key.section]])
    hint = f"; is '{prefix}{near}' meant to be '{prefix}{key.name}'?" if near else ""
    return f"key '{prefix}{key.name}' is missing{hint}"


def _refuse_misspelt(content: dict[str, Any], known: Keys, where: str) -> None:
    """Refuse keys that look like an optional one that is not there; other unknown keys are remarks."""
    for section, names in known.items():
        part = content.get(section) if section else content
        if not isinstance(part, dict):
            continue
        for name in part:
            near = nearest(str(name), sorted(names - set(part))) if name not in names else None
            if near:
                path = f"{section}.{name}".strip(".")
                raise UnreadableRecording(f"{where}: key '{path}' is not known; did you mean '{near}'?")
