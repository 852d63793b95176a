"""What may take long is done seldom enough."""

import pytest

from omninav.pipeline.jobs.throttle import Throttle


class Clock:
    """Seconds that pass when they are told to."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.mark.parametrize(("takes_s", "pause_s"), [(1.0, 20.0), (0.01, 0.5), (0.0, 0.5)])
def test_it_waits_20_times_as_long_as_it_took_and_never_less_than_it_is_told(
    monkeypatch: pytest.MonkeyPatch, takes_s: float, pause_s: float
) -> None:
    clock, done = Clock(), []
    monkeypatch.setattr("time.monotonic", clock)

    def work() -> None:
        clock.now += takes_s
        done.append(clock.now)

    throttle = Throttle(0.5)
    assert throttle.pause == 0.0
    throttle(work)
    assert throttle.pause == pytest.approx(pause_s)
    throttle(work)
    assert len(done) == 1
    clock.now += pause_s + 1e-6
    throttle(work)
    assert len(done) == 2
