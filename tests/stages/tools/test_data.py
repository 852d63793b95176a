from pathlib import Path

import pytest

from omninav.pipeline import BadInput, Context
from omninav.stages.tools.data import ListData

OWN = """
like: tum
about: {what: a cellar, site: https://example.org, run: variant=omninav log=cellar:FOLDER, licence: CC0}
"""


def test_data_sets_are_listed_with_those_of_own_layouts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cellar.yaml").write_text(OWN)
    ListData(layout_folders=(str(tmp_path),)).run(Context("data"))
    said = capsys.readouterr().out
    assert "cold " in said
    assert "https://www.cvlibs.net/datasets/kitti-360/" in said
    assert "cellar           a cellar" in said


def test_of_one_data_set_all_is_said_that_is_known(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "cellar.yaml").write_text(OWN)
    ListData(name="cellar", layout_folders=(str(tmp_path),)).run(Context("data"))
    said = capsys.readouterr().out.splitlines()
    assert said[2:] == [
        "size       see its site",
        "licence    CC0",
        "run        omninav variant=omninav log=cellar:FOLDER",
    ]
    with pytest.raises(BadInput, match="did you mean 'cold'"):
        ListData(name="clod").run(Context("data"))
