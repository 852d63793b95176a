"""`python -m omninav` is the command `omninav`."""

import sys

folder = __file__.rpartition("/omninav/")[0]
if not sys.flags.safe_path and sys.path[0] != folder:  # Python puts the working directory first; nothing there is ours
    del sys.path[0]

from omninav.pipeline.cli.main import main  # noqa: E402

raise SystemExit(main())
