"""The command `omninav`, which is also `python -m omninav`."""

import gc
import os
import sys

if __name__ == "__main__":
    folder = __file__.rpartition("/omninav/")[0]
    if not sys.flags.safe_path and sys.path[0] != folder:  # Python puts the working directory first; nothing is ours
        del sys.path[0]

for threads in ("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    # Read as numpy is loaded. Several threads make products of small matrices five times slower, and round differently.
    os.environ.setdefault(threads, "1")

try:
    from omninav.pipeline.cli.main import main
except KeyboardInterrupt:
    print("stopped", file=sys.stderr)
    raise SystemExit(130) from None

gc.set_threshold(50_000)  # a tick makes a thousand objects and drops them: seldom are there circles among them

if __name__ == "__main__":
    raise SystemExit(main())
