import pytest
from sample_metrics import measured

from omninav.pipeline import Metrics, MetricSpec
from omninav.pipeline.report.headlines import MAX_ROWS, headline_rows


def shown(metrics: Metrics, timing: dict | None = None) -> list[tuple[str, str]]:
    return [(row.name, row.text) for row in headline_rows(metrics, timing or {})]


def test_headlines_stand_first_and_the_speed_last():
    assert shown(measured(), {"ticks_per_second": 24.71}) == [
        ("Position error, median, after convergence", "0.050 m"),
        ("Loss rate", "12.5 %"),
        ("Converged", "after 12 frames"),
        ("Speed", "24.7 frames/s"),
    ]
    assert not any(row.off for row in headline_rows(measured(), {"ticks_per_second": 24.71}))
    assert shown(measured(), {"ticks_per_second": 100.2, "cached": ["features"]})[-1] == (
        "Speed, features from the cache",
        "100 frames/s",
    )


@pytest.mark.parametrize(
    ("value", "text", "off"),
    [(0, "at once", False), (1, "after 1 frame", False), (12, "after 12 frames", True), (None, "never", True)],
)
def test_a_metric_that_is_not_as_it_should_be_is_off(value, text, off):
    described = {"after_frames": MetricSpec(title="Found", before="after", zero="at once", absent="never", most=10)}
    (row,) = headline_rows(Metrics({"after_frames": value}, described, ("after_frames",)), {})
    assert (row.name, row.text, row.off) == ("Found", text, off)


def test_a_share_is_off_below_its_least():
    described = {"held": MetricSpec(title="95 % ellipse holds", unit="%", least=0.85)}
    found = [headline_rows(Metrics({"held": share}, described, ("held",)), {})[0].off for share in (0.84, 0.85, 1.0)]
    assert found == [True, False, False]


def test_metrics_of_one_of_several_logs_say_so():
    assert shown(Metrics({"b": 3, "logs": [{}, {}]}, headlines=("b",))) == [
        ("Log", "the last of 2; of each, `logs` in metrics.json"),
        ("B", "3"),
    ]
    assert shown(Metrics({"b": 3, "logs": [{}]}, headlines=("b",))) == [("B", "3")]


def test_what_has_no_value_has_no_line():
    assert shown(Metrics({"a": None, "b": 3}, headlines=("a", "b", "c"))) == [("B", "3")]


def test_where_nothing_is_said_to_come_first_each_entry_has_one_line():
    spread = {"mean": 0.2, "median": 0.1, "max": 3.0}
    several = {f"count_{number}": number for number in range(20)}
    found = shown(Metrics({"error_m": spread} | several), {"ticks_per_second": 9})
    assert len(found) == MAX_ROWS
    assert found[-1] == ("Speed", "9.00 frames/s")
    hidden = Metrics({"error_m": spread, "hidden": {"a": 1}}, details=("hidden",))
    assert shown(hidden) == [("Error, median", "0.100 m")]
