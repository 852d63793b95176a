"""Plots homing vectors over the floor, towards one target."""

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Colour
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing_field import HomingField

from .drawing import extent_of
from .plan_chart import draw_surroundings, plan_chart

BANDS: tuple[tuple[float, float, Colour, str], ...] = (
    (0.0, 15.0, "green", "wrong by less than 15°"),
    (15.0, 45.0, "blue", "15 to 45°"),
    (45.0, 181.0, "orange", "more than 45°"),
)
"""Errors of the direction, degrees: from, to before, and how they are drawn. The experiment's claims ask for 15."""


class ShowHomingVectors(PlotStage):
    """Plots a dart where each view was taken, along its homing vector, coloured by its error.

    As Figure 15 of Goedemé et al. 2007. With `plan` wired the world's floor plan is under them. Gives nothing where
    there is no field.
    """

    def step(self, ctx: Context, field: HomingField | None = None, plan: FloorPlan | None = None) -> PlotStage.Out:
        if field is None:
            return self.Out()
        found, degrees = np.isfinite(field.directions), np.degrees(field.errors)
        median = float(np.median(np.where(found, degrees, 180.0)))
        return self.drawn(
            name="homing_vectors",
            title="Homing vectors",
            caption=f"From {len(degrees)} views to one target; {int(found.sum())} of them have a homing vector. "
            f"Median error of the direction: {median:.1f}° (a view without a vector counts as 180°). Crosses: no "
            "vector. Rings: every 2 m.",
            content=_draw(field, plan),
            order=8,
        )


def _draw(field: HomingField, plan: FloorPlan | None) -> bytes:
    chart = plan_chart(extent_of(field.poses, field.target[None], margin=0.06), (190.0, 560.0))
    draw_surroundings(chart, None, None, plan)
    around = np.linspace(0.0, 2.0 * np.pi, 73)
    for metres in np.arange(2.0, float(field.metres.max()) + 1.0, 2.0):
        ring = field.target[:2] + metres * np.stack([np.cos(around), np.sin(around)], axis=-1)
        chart.base.line(ring, "line", 0.8)
    found = np.isfinite(field.directions)
    size = float(np.clip(0.55 * _spacing(field.poses) * chart.x.per_unit, 4.0, 12.0))
    for low, high, colour, name in BANDS:
        some = found & (np.degrees(field.errors) >= low) & (np.degrees(field.errors) < high)
        for (x, y, _), direction in zip(field.poses[some], field.directions[some], strict=True):
            chart.base.dart(np.array([x, y, direction]), colour, size)
        if some.any():
            chart.name(name, colour)
    if not found.all():
        chart.base.crosses(field.poses[~found], "grey", 3.0)
        chart.name("no vector", "grey", "square")
    chart.base.dart(field.target, "ink", 12.0)
    chart.name("target", "ink")
    return chart.svg()


def _spacing(poses: np.ndarray) -> float:
    """Typical distance of neighbours."""
    if len(poses) < 2:
        return 1.0
    apart = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))
