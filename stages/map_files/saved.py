"""Maps as they are saved, with what their files state of how they were made."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omninav.pipeline import BadInput, user_path
from omninav.pipeline.engine.artifact import artifact_digest, read_artifact, read_header, write_artifact
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.topological_map import TopologicalMap

MapOfPlaces = ReferenceGraph | TopologicalMap
"""Maps that these tools can join, thin and cut."""
SEEN_BY = ("unwarp", "features", "points", "global_descriptor")
"""Nodes that decide what a map's views are: maps that differ in them do not join."""


@dataclass(frozen=True)
class SavedMap:
    """A map and where it is from."""

    path: Path
    map: MapOfPlaces
    facts: dict[str, Any]


def read_saved(files: str | Sequence[str] | None, at_least: int = 1, at_most: int | None = None) -> list[SavedMap]:
    """Maps in `.omap` files. Raises BadInput where there are too few or many, or one is of another kind."""
    names = (files,) if isinstance(files, str) else tuple(files or ())
    if len(names) < at_least or (at_most is not None and len(names) > at_most):
        wanted = f"{at_least} map" if at_least == at_most else f"at least {at_least} map{'s' if at_least > 1 else ''}"
        raise BadInput(f"maps: {len(names)} files are given, expected {wanted}; type FILE.omap, or maps=[FILE.omap,…]")
    return [_read(user_path(name)) for name in names]


def _read(path: Path) -> SavedMap:
    value = read_artifact(path)
    if not isinstance(value, MapOfPlaces):
        kinds = " and ".join(kind.__name__ for kind in (ReferenceGraph, TopologicalMap))
        raise BadInput(f"{path}: it holds a {type(value).__name__}; this works on a {kinds}")
    return SavedMap(path, value, read_header(path)["facts"])


def target(out: str, sources: Sequence[SavedMap]) -> Path:
    """The file to write. Raises BadInput where it is no `.omap`, a map that is read, or one learned from a log."""
    path = user_path(out)
    if path.suffix != ".omap":
        raise BadInput(f"out={out}: a map is written to a file that ends in .omap; type out=NAME.omap")
    if path.resolve() in (source.path.resolve() for source in sources):
        raise BadInput(f"out={out}: this map is read; type another name")
    if path.exists() and "made_by" not in read_header(path)["facts"]:
        raise BadInput(f"out={out}: it is there, and was not made of other maps; type another name, or delete it")
    return path


def write_saved(path: Path, map: MapOfPlaces, sources: Sequence[SavedMap], how: str) -> None:
    """Write a map that was made of others: what all their files state equally, and which they were."""
    first = sources[0].facts
    same = {key: value for key, value in first.items() if all(other.facts.get(key) == value for other in sources)}
    stages = first.get("stages")
    if isinstance(stages, dict):
        alike = [name for name in stages if all(_stage(other, name) == stages[name] for other in sources)]
        same["stages"] = {name: stages[name] for name in alike}
    made_of = [{"file": source.path.name, "sha256": artifact_digest(source.path)} for source in sources]
    write_artifact(path, map, {**same, "made_of": made_of, "made_by": how})


def refuse_other_views(sources: Sequence[SavedMap]) -> None:
    """Raise BadInput where the views of two maps were made in different ways, as far as their files state."""
    for one, other in ((sources[0], other) for other in sources[1:]):
        for node in SEEN_BY:
            before, after = _stage(one, node), _stage(other, node)
            if before is not None and after is not None and before != after:
                names = sorted(key for key in {*before, *after} if before.get(key) != after.get(key))
                differs = ", ".join(f"{name}={after.get(name)!s:.40} and {before.get(name)!s:.40}" for name in names)
                raise BadInput(
                    f"{other.path}: its views were made with other {node} than {one.path}'s ({differs:.300})"
                )


def _stage(saved: SavedMap, node: str) -> dict[str, Any] | None:
    stages = saved.facts.get("stages")
    found = stages.get(node) if isinstance(stages, dict) else None
    return found if isinstance(found, dict) else None
