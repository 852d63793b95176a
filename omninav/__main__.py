"""`python -m omninav` is the command `omninav`."""

from omninav.pipeline.cli.main import main

raise SystemExit(main())
