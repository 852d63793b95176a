"""Reports damaged files that are made again, once, on the terminal and in the run's log."""

import logging
import sys

_log = logging.getLogger("omninav")
_shown: set[str] = set()


def report_damage(what: str) -> None:
    """Say in one line what was damaged and what is done about it."""
    if what in _shown:
        return
    _shown.add(what)
    print(what, file=sys.stderr, flush=True)
    if _log.handlers:
        _log.warning("%s", what)
