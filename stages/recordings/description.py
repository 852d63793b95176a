"""Descriptions of image folders: found by name, read from YAML, checked."""

from collections.abc import Sequence
from importlib import resources
from pathlib import Path
from typing import Any

import yaml

from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import nearest

from .image_folder import Description
from .recording import UnreadableRecording


def known_layouts(layouts: Sequence[str] = ()) -> dict[str, Path]:
    """Descriptions by name: the built-in ones, then those in further folders, which go first where names are equal."""
    folders = [Path(str(resources.files("omninav.conf"))) / "recording", *(Path(folder) for folder in layouts)]
    return {path.stem: path for folder in folders for path in sorted(folder.glob("*.yaml"))}


def read_description(path: Path, layouts: Sequence[str] = ()) -> Description:
    """A description from a file. Its key `like` names another one, which it changes key by key.

    Raises `UnreadableRecording` naming the file and every key that is wrong.
    """
    content = _read(path, layouts, ())
    description, problems = convert(content, Description, "")
    if problems:
        said = "; ".join(f"{p.where.lstrip('.')}: {p.what}" + (f" ({p.hint})" if p.hint else "") for p in problems)
        raise UnreadableRecording(f"{path}: {said}".replace("'.", "'"))
    found: Description = description
    return found


def find_layout(name: str, layouts: Sequence[str] = ()) -> Path:
    """The file that describes a layout: its name, or a path. Raises `UnreadableRecording` with the nearest name."""
    known = known_layouts(layouts)
    if name in known:
        return known[name]
    path = Path(name).expanduser()
    if path.suffix in (".yaml", ".yml"):
        if path.is_file():
            return path
        raise UnreadableRecording(f"{path}: no such file")
    near = nearest(name, known)
    hint = f"did you mean '{near}'? " if near else ""
    raise UnreadableRecording(f"no layout '{name}'; {hint}layouts: {', '.join(sorted(known))}, or a path to a .yaml")


def _read(path: Path, layouts: Sequence[str], seen: tuple[Path, ...]) -> dict[str, Any]:
    if path in seen:
        raise UnreadableRecording(f"{path}: 'like' leads back to itself")
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise UnreadableRecording(f"{path}: {error.strerror or error}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise UnreadableRecording(f"{path}: not readable as YAML ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise UnreadableRecording(f"{path}: must hold keys (frames, positions, …)")
    like = content.pop("like", None)
    if like is None:
        return content
    return _merged(_read(find_layout(str(like), layouts), layouts, (*seen, path)), content)


def _merged(under: dict[str, Any], over: dict[str, Any]) -> dict[str, Any]:
    both = dict(under)
    for key, value in over.items():
        nested = isinstance(value, dict) and isinstance(both.get(key), dict)
        both[key] = _merged(both[key], value) if nested else value
    return both
