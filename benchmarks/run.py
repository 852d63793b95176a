"""`make bench`: every figure of speed and size, with what it is compared with. Nothing here is a test."""

import importlib
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

PARTS = """
    engine images retrieval renderer filter visibility cml mixtures topological homing logs command_line session jobs
"""


def main() -> int:
    """Run all parts, or those that are named, on one thread of OpenCV's, and print one table."""
    import cv2

    from benchmarks.table import Row, printed

    cv2.setNumThreads(1)  # so that ratios hold on any machine
    rows: list[Row] = []
    for part in sys.argv[1:] or PARTS.split():
        print(f"measuring {part} …", file=sys.stderr)
        rows += importlib.import_module(f"benchmarks.{part}").rows()
    print(printed(rows))
    missed = [row.what for row in rows if row.reached is False]
    print(f"\n{len(rows)} figures, {len(missed)} beyond their limit" + (f": {'; '.join(missed)}" if missed else ""))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
