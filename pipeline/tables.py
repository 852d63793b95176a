"""Tables as files: CSV for whoever reads or types, Parquet for programs."""

from collections.abc import Callable, Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .files import whole_file
from .graph.problems import BadInput

if TYPE_CHECKING:
    import numpy.typing as npt


def write_table(path: Path, columns: Mapping[str, "npt.NDArray[Any]"]) -> None:
    """Write columns of one length as `<path>.csv` and `<path>.parquet`. What is NaN or masked is an empty cell.

    Numbers are written with all their digits, so that both files hold the same.
    """
    import pyarrow as pa
    import pyarrow.csv as csv
    import pyarrow.parquet as parquet

    table = pa.table({name: pa.array(values, from_pandas=True) for name, values in columns.items()})
    with whole_file(path.with_name(f"{path.name}.csv")) as part, part.open("wb") as file:
        file.write((",".join(columns) + "\n").encode())
        csv.write_csv(table, file, csv.WriteOptions(include_header=False))
    with whole_file(path.with_name(f"{path.name}.parquet")) as part:
        parquet.write_table(table, part)


def read_table(path: Path, wanted: Callable[[str], bool] = lambda name: True) -> Any:
    """The wanted columns of a Parquet file: a pandas DataFrame where pandas is installed, else a pyarrow Table."""
    import pyarrow.parquet as parquet

    try:
        names = [name for name in parquet.read_schema(path).names if wanted(name)]
        table = parquet.read_table(path, columns=names)
    except (OSError, ValueError) as error:
        raise BadInput(f"{path}: not a table that can be read ({str(error).splitlines()[0]:.120})") from None
    return table.to_pandas() if find_spec("pandas") is not None else table
