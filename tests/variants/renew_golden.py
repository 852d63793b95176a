"""Renews golden.json: python tests/variants/renew_golden.py [VARIANT …], without names for all variants.

What has changed is printed, to be read before it is committed.
"""

import os
import sys
import tempfile
from contextlib import redirect_stdout
from pathlib import Path

from golden_figures import RUNS, measured, read_golden, write_golden


def renew(variants: list[str]) -> None:
    """Run these variants and put their figures in place of the old ones."""
    figures = {name: kept for name, kept in read_golden().items() if name in RUNS}
    with tempfile.TemporaryDirectory() as scratch:
        for name in variants:
            with open(os.devnull, "w") as nowhere, redirect_stdout(nowhere):
                new = measured(name, Path(scratch) / name, Path(scratch) / "cache")
            old = figures.get(name, {})
            for key in sorted(old.keys() | new.keys()):
                if old.get(key) != new.get(key):
                    print(f"{name}: {key}: {old.get(key, 'absent')} -> {new.get(key, 'absent')}", flush=True)
            figures[name] = new
            write_golden(figures)


if __name__ == "__main__":
    renew(sys.argv[1:] or sorted(RUNS))
