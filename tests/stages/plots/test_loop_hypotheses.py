"""The making of a topological map, drawn."""

from made_tour import Landmarks, along, mapped, scattered

from omninav.pipeline import Context
from omninav.stages.plots.loop_hypotheses import ShowLoopHypotheses


def test_hypotheses_and_map_are_drawn_the_same_every_time() -> None:
    way = [(5.0, 5.0), (20.0, 5.0), (20.0, 9.0), (5.0, 9.0), (5.0, 5.0), (20.0, 5.0)]
    made = mapped(Landmarks(scattered(25.0, 14.0, 400)), [along(way, 1.2)])
    one, other = (ShowLoopHypotheses().step(Context("view"), made.hypotheses, made.map).plot for _ in range(2))
    assert one.content == other.content
    accepted = int(made.hypotheses.accepted.sum())
    assert accepted > 0
    drawn = one.content.decode()
    assert f"accepted ({accepted})" in drawn
    assert f"places ({len(made.map)})" in drawn
    assert f"{accepted} of {len(made.hypotheses.accepted)} hypotheses" in one.caption
    assert f"{len(made.map)} places" in one.caption
