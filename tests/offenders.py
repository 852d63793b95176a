"""One test case for many files or names of a kind: all that do not pass are listed at once."""

from collections.abc import Callable, Iterable
from typing import TypeVar

Case = TypeVar("Case")


def assert_each(cases: Iterable[Case], check: Callable[[Case], None]) -> None:
    """Make a check of each case, and fail with a line for each that fails it; of no case at all too."""
    checked, found = 0, []
    for case in cases:
        checked += 1
        try:
            check(case)
        except Exception as error:
            found.append(f"{case}: {type(error).__name__}: {error}")
    assert checked, "there is nothing to check"
    assert not found, "\n".join(found)
