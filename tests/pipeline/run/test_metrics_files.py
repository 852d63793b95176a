import pytest

from omninav.pipeline import BadInput, Metrics, MetricSpec
from omninav.pipeline.files import digest_file, write_json
from omninav.pipeline.run.metrics_files import read_metrics, write_metrics


def test_metrics_are_read_back_with_their_descriptions(tmp_path):
    described = {"reached_rate": MetricSpec(title="Reached", better="higher"), "error_m": MetricSpec(absent="never")}
    written = Metrics({"reached_rate": 0.5, "error_m": None}, described, ("reached_rate",), ("error_m",))
    write_metrics(tmp_path, written)
    read = read_metrics(tmp_path)
    assert (read.values, read.headlines, read.details) == (written.values, written.headlines, written.details)
    assert list(read.specs) == ["reached_rate", "error_m"]
    assert read.specs["reached_rate"].better == "higher"
    assert read.specs["error_m"].absent == "never"


def test_metrics_without_descriptions_are_read_undescribed_and_a_folder_without_metrics_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no metrics"):
        read_metrics(tmp_path)
    (tmp_path / "metrics.json").write_text('{"error_m": 1.0}')
    assert (read_metrics(tmp_path).values, read_metrics(tmp_path).specs) == ({"error_m": 1.0}, {})


@pytest.mark.parametrize(
    ("name", "content"),
    [
        *((name, content) for name in ("metrics.json", "quantities.json") for content in ("", "[1]", "{")),
        ("quantities.json", '{"quantities": {"a": 1}}'),
        ("quantities.json", '{"quantities": {"a": {"colour": 1}}}'),
    ],
)
def test_metrics_that_cannot_be_read_are_refused_by_name(tmp_path, name, content):
    write_metrics(tmp_path, Metrics({"error_m": 1.0}))
    (tmp_path / name).write_text(content)
    with pytest.raises(BadInput, match=f"{name} is damaged or was changed; `omninav resume"):
        read_metrics(tmp_path)


def test_a_figure_that_the_run_did_not_write_is_found(tmp_path):
    write_metrics(tmp_path, Metrics({"error_m": 1.0}))
    write_json(tmp_path / "manifest.json", {"files": {"metrics.json": digest_file(tmp_path / "metrics.json")}})
    assert read_metrics(tmp_path).values == {"error_m": 1.0}
    (tmp_path / "metrics.json").write_text('{"error_m": 0.1}')
    with pytest.raises(BadInput, match=r"metrics.json is damaged or was changed"):
        read_metrics(tmp_path)
