"""Saved maps: damaged bytes, and files whose sums are right over content that is not."""

import dataclasses
import functools
import hashlib
import io
import json
import math
import re
import tempfile
import zipfile
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any
from unittest.mock import patch

import numpy as np
from landmark_tour import room, seen_from
from made_values import made_values

from omninav.pipeline import Context, StoredRows
from omninav.pipeline.engine import chunks as chunk_files
from omninav.pipeline.engine.artifact import read_artifact, read_header, write_artifact
from omninav.pipeline.engine.chunks import sums_of
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.fusion.landmark_update import LandmarkUpdate, LandmarkUpdateState
from omninav.stages.map_files.point_cloud import ply
from omninav.stages.map_files.references import cut_references, joined_references
from omninav.stages.sensor.landmark_pose import LandmarkPose, LandmarkPoseState
from omninav.stages.values.belief import Particles
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visual_words import VisualWords

from .harness import Format
from .mutations import BINARY, REALS, SIZES, TEXT, Files, on

MAP = "known.omap"
_SUM = "sha256:"
MAX_ITEMS = 1_000_000
"""Of an array that is mutated again: an earlier mutation may have left one of 2^40 items of no bytes."""


@functools.cache
def samples() -> Sequence[Files]:
    """A map of every kind, and what is saved beside maps."""
    with tempfile.TemporaryDirectory() as scratch:
        found = []
        for value in made_values():
            write_artifact(Path(scratch, MAP), value, {"variant": "made", "stages": {}})
            found.append({MAP: Path(scratch, MAP).read_bytes()})
        return found


def read(folder: Path, files: Files) -> Any:
    """Header and value, and the rows that would stay in a larger file, read from there."""
    facts, value = read_header(folder / MAP)["facts"], read_artifact(folder / MAP)
    with patch.object(chunk_files, "IN_MEMORY", 0):
        rows = getattr(read_artifact(folder / MAP), "features", None)
    return facts, value, rows[:] if isinstance(rows, StoredRows) else None


def used(folder: Path, files: Files) -> Any:
    """A map with landmarks, and what an image, a cut and a join make of them."""
    read(folder, files)
    map = read_artifact(folder / MAP)
    assert isinstance(map, ReferenceGraph)
    ctx = Context("landmark_pose", np.random.default_rng(0))
    fix = LandmarkPose().step(ctx, LandmarkPoseState(), _image(), map).fix
    belief = Particles(np.zeros((50, 3)), np.full(50, 0.02))
    return (
        fix,
        LandmarkUpdate().step(ctx, LandmarkUpdateState(), belief, fix).belief,
        cut_references(map, np.arange(len(map)) > 0),
        joined_references([map, map], map.pose_source),
        map.moved(map.poses + 1.0),
        ply(np.empty((0, 3), np.float32) if map.landmarks is None else map.landmarks.points),
    )


@functools.cache
def _image() -> LocalFeatures:
    """Features that the robot sees beside the first references of the map."""
    seen = seen_from(room(), np.array([1.2, 2.4, 0.3]))
    return dataclasses.replace(seen, descriptors=seen.descriptors[:, :8].copy())


def entries_of(data: bytes) -> dict[str, bytes]:
    """The files in a map."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def sealed(entries: dict[str, bytes], level: int = 1) -> bytes:
    """A map of some files, all sums right where there is something to sum."""
    header = _plain(entries.get("header.json", b""))
    names = header.get("front", []) if isinstance(header, dict) else []
    front = [f"{name}.npy" for name in names if f"{name}.npy" in entries] if isinstance(names, list) else []
    buffer, end = io.BytesIO(), 0
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=level) as archive:
        for name in front:
            archive.writestr(zipfile.ZipInfo(name), entries[name])
        if front:
            end = buffer.tell()
            entries = entries | {"chunk_sums.npy": npy(sums_of(io.BytesIO(buffer.getvalue()), end))}
        if isinstance(header, dict) and isinstance(header.get("arrays"), dict):
            entries = entries | {"header.json": json.dumps(_with_sums(header, entries)).encode()}
        for name, content in entries.items():
            if name not in front:
                archive.writestr(name, content)
        archive.comment = (f"front:{end:016}" if front else "").encode() + b" " * (len(_SUM) + 64)
    return _summed(buffer.getvalue()[: -len(_SUM) - 64], end)


def npy(array: Any) -> bytes:
    """The file of an array."""
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.asarray(array), allow_pickle=False)
    return buffer.getvalue()


def fields_of(entries: dict[str, bytes]) -> Any:
    """The fields of a map that are no arrays."""
    return decode(np.load(io.BytesIO(entries["rest.npy"]), allow_pickle=False).tobytes())


def with_fields(entries: dict[str, bytes], fields: Any) -> bytes:
    """A map with other fields that are no arrays."""
    return sealed(entries | {"rest.npy": npy(np.frombuffer(encode(fields), np.uint8))})


def _with_sums(header: dict[str, Any], entries: dict[str, bytes]) -> dict[str, Any]:
    sums = dict(header["arrays"])
    for name in sums:
        try:
            array = np.load(io.BytesIO(entries[f"{name}.npy"]), allow_pickle=False)
            sums[name] = hashlib.sha256(array.tobytes()).hexdigest()
        except Exception:
            continue
    return header | {"arrays": sums}


def _summed(whole: bytes, end: int) -> bytes:
    """Bytes with the sum of those from `end` on behind them."""
    return whole + _SUM.encode() + hashlib.sha256(whole[end:]).hexdigest().encode()


def _plain(data: bytes) -> Any:
    try:
        return json.loads(data)
    except (ValueError, RecursionError):
        return None


def zip_bytes(random: Random, files: Files) -> Files:
    """Damage to the zip, its sum right."""
    whole = random.choice(BINARY)(random, files[MAP][: -len(_SUM) - 64])
    stated = re.search(rb"front:(\d{16})$", whole)
    return files | {MAP: _summed(whole, int(stated[1]) if stated else 0)}


def chunks(random: Random, files: Files) -> Files:
    """Damage to a map's front: its arrays, or what the zip says of them."""
    data = files[MAP]
    stated = re.search(rb"front:(\d{16})$", data[: -len(_SUM) - 64])
    end = int(stated[1]) if stated else 0
    damaged = random.choice(BINARY)(random, data[:end])
    return files | {MAP: damaged[:end].ljust(end, b"\0") + data[end:]}


def arrays(random: Random, files: Files) -> Files:
    """An array of another shape, type or content."""
    entries = _entries(files)
    names = [name for name in entries if name.endswith(".npy") and name != "rest.npy"]
    if not names:
        return files
    name = random.choice(names)
    try:
        with np.errstate(all="ignore"):  # numpy multiplies the sizes that the file says
            array = np.load(io.BytesIO(entries[name]), allow_pickle=False)
    except Exception:
        return files
    if array.size > MAX_ITEMS:
        return files
    return files | {MAP: sealed(entries | {name: npy(mutated(random, array))})}


def mutated(random: Random, array: Any) -> Any:
    """An array of another shape, type or content than the given one."""
    kind = random.randrange(8)
    if kind == 0:
        array = array.reshape(-1)
    elif kind == 1:
        array = array[: random.randrange(len(array) + 1)] if array.ndim else array
    elif kind == 2:
        array = array[None]
    elif kind == 3:
        with np.errstate(all="ignore"):
            array = array.astype(random.choice(("f4", "f8", "i8", "u1", "?", "U3", "c16", "M8[ns]", ">f8", "V3")))
    elif kind == 4 and array.size:
        array = np.array(array, copy=True)
        value = random.choice(REALS) if array.dtype.kind == "f" else random.choice((-1, 0, 1, 2**15, 2**31, 2**62))
        with np.errstate(all="ignore"):
            array.reshape(-1)[random.randrange(array.size)] = np.array([value]).astype(array.dtype)[0]
    elif kind == 5:
        array = np.repeat(array, 2, axis=0) if array.ndim else array
    elif kind == 6:
        array = np.empty((random.choice((0, 3)),) * random.randrange(4), array.dtype)
        array[...] = np.zeros((), array.dtype)
    else:
        array = array.T
    return array


def members(random: Random, files: Files) -> Files:
    """A file of the zip damaged, left out, added or many times as large unpacked."""
    entries = _entries(files)
    name = random.choice(sorted(entries) or ["header.json"])
    kind = random.randrange(5)
    if kind == 0:
        entries.pop(name, None)
    elif kind == 1:
        entries[name] = random.choice(BINARY)(random, entries.get(name, b""))
    elif kind == 2:
        entries["header.json"] = random.choice(TEXT)(random, entries.get("header.json", b"{}"))
    elif kind == 3:
        entries[name] = entries.get(name, b"") + bytes(random.choice((10, 10**6, 5 * 10**7)))
    else:
        shape = "(" + ", ".join(str(random.choice(SIZES)) for _ in range(random.randrange(4))) + ",)"
        kind_of_items = random.choice(("<f8", "|O", "<U9999", "|V0"))
        head = f"{{'descr': '{kind_of_items}', 'fortran_order': False, 'shape': {shape}}}"
        packed = head.encode().ljust(118) + b"\n"
        entries[name] = b"\x93NUMPY\x01\x00" + len(packed).to_bytes(2, "little") + packed
    return files | {MAP: sealed(entries)}


def rest(random: Random, files: Files) -> Files:
    """Other values in the fields that are no arrays."""
    values: tuple[Any, ...] = (None, -1, 2**70, "x" * 9, math.nan, [], {}, (1, 2), True, b"", "", 1e308)
    entries = _entries(files)
    try:
        fields = fields_of(entries)
    except Exception:
        return files
    if not isinstance(fields, dict):
        return files
    if fields and random.random() < 0.8:
        fields[random.choice(sorted(fields))] = random.choice(values)
    else:
        fields[random.choice(("poses", "kind", "surplus", "features"))] = random.choice(values)
    return files | {MAP: with_fields(entries, fields)}


def landmarks(random: Random, files: Files) -> Files:
    """An array of a map's landmarks, or of their words, of another shape, type or content; or another deviation."""
    entries = _entries(files)
    try:
        fields = fields_of(entries)
        found = fields["landmarks"]
        inner = random.choice((found, found, found.words))
    except Exception:
        return files
    names = [field.name for field in dataclasses.fields(inner) if field.name != "words" or inner is not found]
    name = random.choice(names)
    value = getattr(inner, name)
    value = mutated(random, value) if isinstance(value, np.ndarray) else random.choice((0.0, -1.0, 1e300, math.nan))
    inner = dataclasses.replace(inner, **{name: value})
    fields["landmarks"] = dataclasses.replace(found, words=inner) if isinstance(inner, VisualWords) else inner
    return files | {MAP: with_fields(entries, fields)}


def header(random: Random, files: Files) -> Files:
    """A header that names other types, arrays or formats."""
    entries = _entries(files)
    head = _plain(entries.get("header.json", b""))
    if not isinstance(head, dict):
        return files
    reference_graph = "omninav.stages.values.maps.ReferenceGraph"
    things: tuple[Any, ...] = (None, [], {}, 1, -1.5, "x", "os.system", reference_graph, [1])
    head[random.choice((*sorted(head), "surplus"))] = random.choice(things)
    return files | {MAP: sealed(entries | {"header.json": json.dumps(head).encode()})}


def _entries(files: Files) -> dict[str, bytes]:
    try:
        return entries_of(files[MAP])
    except Exception:
        return {}


def _with_landmarks() -> Sequence[Files]:
    return samples()[-1:]


BYTES = Format("map bytes", samples, [on(BINARY), zip_bytes, zip_bytes, chunks], read, cases=200)
CONTENT = Format("map content", samples, [arrays, arrays, arrays, members, rest, header], read, cases=400)
LANDMARKS = Format("landmarks", _with_landmarks, [landmarks], used, cases=150)
