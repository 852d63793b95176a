import json

import pytest

from omninav.pipeline import BadInput, Metrics, Quantity
from omninav.pipeline.run.metrics_files import read_metrics, write_metrics


def test_metrics_are_read_back_with_their_descriptions(tmp_path):
    described = {"reached_rate": Quantity(title="Reached", better="higher"), "error_m": Quantity(absent="never")}
    written = Metrics({"reached_rate": 0.5, "error_m": None}, described, ("reached_rate",), ("error_m",))
    write_metrics(tmp_path, written)
    read = read_metrics(tmp_path)
    assert (read.values, read.headlines, read.details) == (written.values, written.headlines, written.details)
    assert list(read.quantities) == ["reached_rate", "error_m"]
    assert read.quantities["reached_rate"].better == "higher"
    assert read.quantities["error_m"].absent == "never"


def test_metrics_of_a_run_without_descriptions_are_read_undescribed(tmp_path):
    (tmp_path / "metrics.json").write_text(json.dumps({"error_m": 1.0}))
    assert read_metrics(tmp_path).quantities == {}


def test_a_folder_without_metrics_is_refused(tmp_path):
    with pytest.raises(BadInput, match="no metrics"):
        read_metrics(tmp_path)
