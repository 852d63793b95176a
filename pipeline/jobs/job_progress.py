"""Progress of jobs: the frames that each one reports, added up."""

from collections.abc import Mapping
from typing import Any

from .job import Send


class Heartbeat:
    """Sends how far a job is, at some frames."""

    def __init__(self, send: Send) -> None:
        self._send = send

    def update(self, name: str, done: int, total: int | None = None) -> None:
        """`done` frames of `total` have gone through the graph `name`, as for `Progress`."""
        self.step(done, total)

    def say(self, words: str) -> None:
        """Frames alone are shown of many jobs."""

    def step(self, done: int, total: int | None = None) -> None:
        """The same, of the only graph there is."""
        if done == 1 or done % 25 == 0 or done == total:
            self._send({"frames": done, "of": total})


class JobProgress:
    """Frames that jobs have done, and those that they have: the last message of each one, added up."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._frames: dict[str, tuple[int, int | None]] = {}
        self._ended: set[str] = set()

    def on_message(self, job: str, message: Mapping[str, Any]) -> None:
        """A job has sent its `frames` and `of`, as `Heartbeat` does."""
        if "frames" in message:
            self._frames[job] = message["frames"], message.get("of")

    def end(self, job: str, well: bool = True) -> None:
        """A job has come to its end: all its frames are done, or it failed and does no more."""
        done, total = self._frames.get(job, (0, 0))
        done = total if well and total else done
        self._frames[job] = done, done
        self._ended.add(job)

    @property
    def ended(self) -> int:
        """Number of jobs that have ended."""
        return len(self._ended)

    @property
    def done(self) -> int:
        """Frames done in all jobs."""
        return sum(done for done, _ in self._frames.values())

    @property
    def total(self) -> int | None:
        """Frames in all jobs; those that have sent nothing count as the mean of the others. None: nothing is known."""
        known = [total for done, total in self._frames.values() if total]
        silent = self._jobs - len(self._frames)
        if any(total is None for _, total in self._frames.values()) or (silent and not known):
            return None
        return sum(known) + (silent * max(1, round(sum(known) / len(known))) if silent else 0)
