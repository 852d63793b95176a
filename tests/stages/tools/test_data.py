from pathlib import Path

import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.tools.data import ListData

OWN = """
like: tum
about: {what: a cellar, site: https://example.org, run: variant=omninav log=cellar:FOLDER}
"""


def test_data_sets_are_listed_with_those_of_own_layouts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cellar.yaml").write_text(OWN)
    (tmp_path / "mine.yaml").write_text("like: tum\n")
    (tmp_path / "broken.yaml").write_text("frame: {}\n")
    ListData(layout_folders=(str(tmp_path),)).run(Context("data"))
    said = capsys.readouterr().out
    assert "cold " in said
    assert "https://www.cvlibs.net/datasets/kitti-360/" in said
    assert "cellar           a cellar" in said
    assert "\nmine " not in said  # what is said of tum is not said of it
    assert "did you mean 'frames'" in said.splitlines()[-1]


def test_of_one_data_set_all_is_said_that_is_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cellar.yaml").write_text(OWN)
    (tmp_path / "broken.yaml").write_text("frame: {}\n")
    ListData(name="cellar", layout_folders=(str(tmp_path),)).run(Context("data"))
    said = capsys.readouterr().out.splitlines()
    assert said == [
        "what       a cellar",
        "from       https://example.org",
        "run        omninav variant=omninav log=cellar:FOLDER",
    ]
    with pytest.raises(BadInput, match="did you mean 'cold'"):
        ListData(name="clod").run(Context("data"))
    with pytest.raises(BadInput, match=r"broken\.yaml: "):
        ListData(name="broken", layout_folders=(str(tmp_path),)).run(Context("data"))
