"""Tables as files: CSV for people, Parquet for programs."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from .files import whole_file
from .graph.problems import BadInput

UNPACKED_BYTES, UNPACKED_RATIO = 1 << 26, 64
"""Largest table in memory: bytes, and bytes more for each of its file."""
_BATCH = 1000
"""Rows that are unpacked at once."""


def write_table(path: Path, columns: Mapping[str, npt.NDArray[Any]]) -> None:
    """Write columns of one length as `<path>.csv` and `<path>.parquet`. What is NaN or masked is an empty cell.

    Numbers are written with all their digits, so that both files hold the same.
    """
    import pyarrow as pa
    import pyarrow.csv as csv
    import pyarrow.parquet as parquet

    table = pa.table({name: _column(values) for name, values in columns.items()})
    with whole_file(path.with_name(f"{path.name}.csv")) as part, part.open("wb") as file:
        file.write((",".join(columns) + "\n").encode())
        csv.write_csv(table, file, csv.WriteOptions(include_header=False))
    with whole_file(path.with_name(f"{path.name}.parquet")) as part, part.open("wb") as file:
        parquet.write_table(table, file)  # a file, since pyarrow takes no path that is not UTF-8


def _column(values: npt.NDArray[Any]) -> Any:
    """A column whose NaN or masked cells are empty, of numbers and texts as they are: `pa.array` imports pandas."""
    import pyarrow as pa

    plain = np.ascontiguousarray(np.ma.getdata(values))
    if plain.dtype.kind not in "iufU":
        return pa.array(values, from_pandas=True)
    missing = np.ma.getmaskarray(values) | (np.isnan(plain) if plain.dtype.kind == "f" else False)
    buffers = [pa.py_buffer(np.packbits(~missing, bitorder="little")) if missing.any() else None]
    if plain.dtype.kind == "U":
        texts = [text.encode() for text in plain.tolist()]
        ends = np.cumsum([0, *map(len, texts)], dtype=np.int32)
        return pa.Array.from_buffers(pa.string(), len(texts), [*buffers, *map(pa.py_buffer, (ends, b"".join(texts)))])
    return pa.Array.from_buffers(pa.from_numpy_dtype(plain.dtype), len(plain), [*buffers, pa.py_buffer(plain)])


def read_table(path: Path, wanted: Callable[[str], bool] = lambda name: True) -> Any:
    """The wanted columns of a Parquet file: a pandas DataFrame where pandas is installed, else a pyarrow Table."""
    import pyarrow as pa
    import pyarrow.parquet as parquet

    try:
        with path.open("rb") as opened, parquet.ParquetFile(opened) as file:
            schema, left = file.schema_arrow, UNPACKED_BYTES + UNPACKED_RATIO * path.stat().st_size
            names = [name for name in schema.names if wanted(name)]
            batches = []
            for batch in file.iter_batches(_BATCH, columns=names):
                batches.append(batch)
                left -= batch.nbytes
                if left < 0:
                    raise BadInput(f"{path}: it unpacks to more than a table of its size holds; is it damaged?")
        table = pa.Table.from_batches(batches, pa.schema([schema.field(name) for name in names], schema.metadata))
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: not a table that can be read ({str(error).splitlines()[0]:.120})") from None
    return table.to_pandas() if find_spec("pandas") is not None else table
