"""Errors that a user can mend, raised as `BadInput` whatever has met them."""

from collections.abc import Iterator
from contextlib import contextmanager

from omninav.pipeline.graph.problems import as_bad_input


@contextmanager
def plain_errors() -> Iterator[None]:
    """Raise `BadInput`, with what to do, where the system refuses a file or a folder."""
    try:
        yield
    except OSError as error:
        raise (as_bad_input(error) or error) from None
