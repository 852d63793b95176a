import pytest
from sample_metrics import measured

from omninav.pipeline import Metrics, MetricSpec
from omninav.pipeline.report.metrics import best_of, digits, metric_values, title, unit


@pytest.mark.parametrize(
    ("number", "text"),
    [
        (0.0731, "0.073"),
        (1.523, "1.52"),
        (12.34, "12.3"),
        (3500.2, "3500"),
        (0, "0"),
        (0.0, "0"),
        (0.00012, "0.00012"),
        (3.3e-14, "0"),
        (-2e-9, "0"),
        (1e-6, "0.0000010"),
        (0.0005, "0.001"),
        (1.0, "1.00"),
        (-10.0, "-10.0"),
        (100.0, "100"),
        (9999, "9999"),
        (-10_000, "-10\u2009000"),
    ],
)
def test_numbers_have_the_digits_they_carry(number, text):
    assert digits(number) == text


def test_titles_and_units_follow_from_the_ends_of_names():
    names = ("position_error_m", "heading_error_deg", "loss_rate", "frames")
    titles, units = ("Position error", "Heading error", "Loss rate", "Frames"), ("m", "°", "%", "")
    assert (tuple(map(title, names)), tuple(map(unit, names))) == (titles, units)


@pytest.mark.parametrize(
    ("name", "value", "spec", "head", "text"),
    [
        ("loss_rate", 0.015, MetricSpec(), "Loss rate (%)", "1.50"),
        ("size_bytes", 1234, MetricSpec(), "Size (kB)", "1.23"),
        ("precision", 0.5, MetricSpec(title="Precision of loops", unit="%"), "Precision of loops (%)", "50.0"),
        ("after_frames", None, MetricSpec(absent="never"), "After (frames)", "never"),
        ("after_frames", None, MetricSpec(), "After (frames)", "–"),
        ("after_frames", 0, MetricSpec(title="Found", before="after", zero="at once"), "Found after (frames)", "0"),
    ],
)
def test_a_description_takes_precedence_over_the_name(name, value, spec, head, text):
    found = metric_values(Metrics({name: value}, {name: spec}))[name]
    assert (found.head, found.text) == (head, text)


def test_every_number_has_its_path_and_a_readable_name():
    found = {path: number.name for path, number in metric_values(measured()).items()}
    assert found["after_convergence.position_error_m.median"] == "Position error, median, after convergence"
    assert found["map.references"] == "References, map"


def test_a_title_given_for_a_path_is_shown_without_its_groups():
    described = {"success.at_end": MetricSpec(title="Final pose correct")}
    found = metric_values(Metrics({"success": {"at_end": 1.0}}, described))
    assert found["success.at_end"].name == "Final pose correct"


def test_described_entries_come_first_in_their_order():
    metrics = Metrics({"a": 1, "b": 2, "c": 3, "d": 4}, {"c": MetricSpec(), "b": MetricSpec()})
    assert list(metric_values(metrics)) == ["c", "b", "a", "d"]


def test_what_a_figure_was_measured_with_is_no_result():
    assert list(metric_values(Metrics({"a": 1, "radius_m": 2.0}, {"radius_m": MetricSpec(setting=True)}))) == ["a"]


def test_the_best_of_several_runs_are_those_with_its_best_number():
    for better, values, best in (
        ("lower", (0.5, 0.1, 0.1), {1, 2}),
        ("higher", (0.5, 0.1, None), {0}),
        ("lower", (0.5, 0.5), set()),
        (None, (0.5, 0.1), set()),
    ):
        runs = [metric_values(Metrics({"error": value}, {"error": MetricSpec(better=better)})) for value in values]
        assert best_of("error", [*runs, {}]) == best
