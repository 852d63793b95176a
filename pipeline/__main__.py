"""`python -m omninav.pipeline` is `omninav`."""

from .app import main

raise SystemExit(main())
