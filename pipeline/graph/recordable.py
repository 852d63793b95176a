"""Protocol of a source that computes its values: it is recorded once and replayed where the same is needed again."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from .stage import Context


@runtime_checkable
class Recordable(Protocol):
    """A source that may compute what it gives (a simulation), and can be set to read a recording of it instead.

    An experiment records it once and lets all conditions with the same key replay the recording.
    """

    def recording_key(self) -> str | None:
        """The hash of everything that decides the recording; None where there is nothing to record."""

    def recording_name(self) -> str:
        """Description of the recording, for people to read."""

    def record(self, ctx: Context, folder: Path) -> None:
        """Write the recording into a folder, which exists. `ctx` takes progress and facts; nothing random is drawn."""

    def replay(self, folder: Path) -> Mapping[str, Any]:
        """The parameters with which the source reads the recording in a folder; None leaves one to its default."""
