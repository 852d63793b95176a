"""A sound recording, and how one that cannot be used is refused."""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest
from made_logs import write_mcap

from omninav.pipeline.graph.problems import BadInput
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording


@pytest.fixture(scope="session")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """The made log as it is, to be read only."""
    return open_recording(str(write_mcap(tmp_path_factory.mktemp("whole") / "log.mcap")))


@contextmanager
def refused(said: str) -> Iterator[None]:
    """Expects a refusal in one short line that fits."""
    with pytest.raises(BadInput, match=said) as caught:
        yield
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 1000
