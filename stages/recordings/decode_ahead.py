"""Images decoded in a thread while those before them are worked on."""

from collections.abc import Callable, Sequence
from concurrent.futures import Future, ThreadPoolExecutor

from omninav.stages.values.image import Pixels

AHEAD = 4
"""Most images that are decoded before they are asked for."""


class DecodeAhead:
    """Decodes the images that will be asked for next while the caller works on the present one.

    `fetch` reads an image and returns what decodes it. It runs in the caller's thread, for a file has one reader at a
    time; what it returns runs in another, where OpenCV lets Python go on. An image, or the error that it raises, is the
    same whether or not it was expected, and comes when it is asked for.
    """

    def __init__(self, fetch: Callable[[int], Callable[[], Pixels]]) -> None:
        self._fetch = fetch
        self._thread: ThreadPoolExecutor | None = None
        self._coming: dict[int, Future[Pixels]] = {}

    def image(self, frame: int, following: Sequence[int] = ()) -> Pixels:
        """An image. `following`: the frames that will be asked for next, in their order."""
        decoded = self._coming.get(frame)
        self._coming = {after: self._coming.get(after) or self._begun(after) for after in following[:AHEAD]}
        return self._fetch(frame)() if decoded is None else decoded.result()

    def _begun(self, frame: int) -> Future[Pixels]:
        if self._thread is None:
            self._thread = ThreadPoolExecutor(1, "decode")
        try:
            return self._thread.submit(self._fetch(frame))
        except Exception as error:  # raised when the image is asked for
            failed: Future[Pixels] = Future()
            failed.set_exception(error)
            return failed
