import struct

import matplotlib
import pytest

from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.report.plot_style import plot, plot_file


def test_plots_have_one_look_whatever_a_user_has_set_and_replace_no_other_picture(tmp_path):
    def drawn():
        with plot(2.0, 1.0) as drawing:
            axes = drawing.canvas.subplots()
            axes.set_title("error")
            (line,) = axes.plot([0, 1], label="of all")
            texts = (axes.xaxis.label, axes.title, axes.legend().get_texts()[0])
            looks = [text.get_size() for text in texts], line.get_linewidth(), axes.title.get_fontfamily()
            edges, grid = {n for n, spine in axes.spines.items() if spine.get_visible()}, axes.xaxis.get_gridlines()[0]
            return drawing, (*looks, edges, grid.get_visible(), grid.get_linewidth(), axes.get_axisbelow())

    drawing, looks = drawn()
    assert struct.unpack(">II", drawing.content[16:24]) == (220, 110)
    assert looks == ([9, 10, 8.5], 1.5, ["DejaVu Sans"], {"left", "bottom"}, True, 0.6, True)
    with matplotlib.rc_context({"lines.linewidth": 9.0, "axes.facecolor": "black"}):
        assert drawn()[0].content == drawing.content
        assert matplotlib.rcParams["lines.linewidth"] == 9.0
    (tmp_path / "ours.png").write_bytes(drawing.content)
    (tmp_path / "photo.png").write_bytes(b"\x89PNG of a camera")
    assert [plot_file(str(tmp_path / name)).name for name in ("ours.png", "new.png")] == ["ours.png", "new.png"]
    for name, said in (("photo.png", "omninav did not draw it"), ("plot.pdf", r"type out=NAME\.png")):
        with pytest.raises(BadInput, match=said):
            plot_file(str(tmp_path / name))
