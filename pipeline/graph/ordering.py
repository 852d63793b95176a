"""Orders nodes by what they wait for: what follows from a node, circles, and the order in which they run."""

import heapq
import itertools
from collections.abc import Callable, Iterable, Iterator
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
        done: set[str] = set()
        for root in self._later:
            path: dict[str, Iterator[str]] = {} if root in done else {root: iter(self._later[root])}
            while path:
                last = next(reversed(path))
                later = next(path[last], None)
                if later is None:
                    done.add(last)
                    del path[last]
                elif later in path:
                    names = [*path]
                    return names[names.index(later) :]
                elif later not in done:
                    path[later] = iter(self._later[later])
        return None

    def ordered(self, key: Callable[[str], Any]) -> Iterator[str]:
        """The names, each after those that it waits for, and of those that could be next the one of the lowest key.

        Keys differ, and there is no circle.
        """
        waits_for = dict.fromkeys(self._later, 0)
        for name in itertools.chain(*self._later.values()):
            waits_for[name] += 1
        ready = [(key(name), name) for name, number in waits_for.items() if not number]
        heapq.heapify(ready)
        while ready:
            name = heapq.heappop(ready)[1]
            yield name
            for later in self._later[name]:
                waits_for[later] -= 1
                if not waits_for[later]:
                    heapq.heappush(ready, (key(later), later))
