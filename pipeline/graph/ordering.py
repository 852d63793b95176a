"""Orders nodes by what they wait for: what follows from a node, circles, and the order in which they run."""

import heapq
from collections.abc import Callable, Iterable, Iterator
from graphlib import CycleError, TopologicalSorter
from typing import Any


class Following:
    """A directed graph over names: each name, and those that wait for it."""

    def __init__(self, names: Iterable[str]) -> None:
        self._later: dict[str, dict[str, None]] = {name: {} for name in names}

    def add(self, first: str, later: str) -> None:
        """State that `later` waits for `first`."""
        self._later.setdefault(later, {})
        self._later.setdefault(first, {})[later] = None

    def remove(self, first: str, later: str) -> None:
        """Take back that `later` waits for `first`."""
        del self._later[first][later]

    def after(self, *names: str) -> set[str]:
        """All that wait for one of the names, directly or not."""
        found: set[str] = set()
        waiting = list(names)
        while waiting:
            new = self._later[waiting.pop()].keys() - found
            found |= new
            waiting += new
        return found

    def circle(self) -> list[str] | None:
        """Names that wait for each other, one behind the other; None where there are none."""
        try:
            self._sorter().prepare()
        except CycleError as error:
            return [*error.args[1][:-1]]  # its last is its first again
        return None

    def ordered(self, key: Callable[[str], Any]) -> Iterator[str]:
        """The names, each after those that it waits for, and of those that could be next the one of the lowest key.

        Keys differ, and there is no circle.
        """
        sorter, ready = self._sorter(), list[tuple[Any, str]]()
        sorter.prepare()
        while sorter.is_active():
            for name in sorter.get_ready():
                heapq.heappush(ready, (key(name), name))
            name = heapq.heappop(ready)[1]
            yield name
            sorter.done(name)

    def _sorter(self) -> TopologicalSorter[str]:
        sorter: TopologicalSorter[str] = TopologicalSorter(dict.fromkeys(self._later, ()))
        for first, names in self._later.items():
            for later in names:
                sorter.add(later, first)
        return sorter
