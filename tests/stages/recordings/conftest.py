"""How a recording that cannot be used is refused."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from omninav.pipeline.graph.problems import BadInput


@contextmanager
def refused(said: str) -> Iterator[None]:
    """What happens here is refused in one short line that fits."""
    with pytest.raises(BadInput, match=said) as caught:
        yield
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000
