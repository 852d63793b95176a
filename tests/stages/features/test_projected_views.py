"""Views by principal components, against turned strips."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.features.averaged import AveragedView
from omninav.stages.features.pca import PrincipalComponents
from omninav.stages.mapping.principal_components import LearnPrincipalComponents
from omninav.stages.values.image import Panorama
from omninav.stages.values.projection import Projection
from omninav.stages.values.views import Coefficients

RNG = np.random.default_rng(11)
PICTURES = [
    np.kron(RNG.integers(0, 256, (4, 18, 3), dtype=np.uint8), np.ones((20, 20, 1), np.uint8)) for _ in range(12)
]


def averaged(pixels: np.ndarray, headings: int = 1) -> Coefficients:
    stage = AveragedView(rows=4, columns=36, headings=headings)
    return stage.step(Context("features"), Panorama(pixels)).view


def projected(pixels: np.ndarray, projection: Projection) -> Coefficients:
    stage = PrincipalComponents(rows=4, columns=36)
    context = Context("features")
    stage.setup(context)
    return stage.step(context, Panorama(pixels), projection).view


@pytest.mark.parametrize("columns", [0, 30, -110])
def test_a_projected_view_knows_itself_turned(columns: int) -> None:
    learned = LearnPrincipalComponents(components=60).step(Context("m"), [averaged(p) for p in PICTURES]).projection
    kept = projected(PICTURES[3], learned).values[None]
    view = projected(np.roll(PICTURES[3], columns, axis=1), learned)
    assert view.distances(kept)[0] < 1e-3 * np.linalg.norm(kept)
    assert abs(math.remainder(view.turns(kept)[0] - math.radians(columns), 2 * math.pi)) < math.radians(2)
    strips = averaged(np.roll(PICTURES[3], columns, axis=1), headings=36)
    assert strips.turns(averaged(PICTURES[3]).values[None]) == pytest.approx(view.turns(kept), abs=math.radians(2))


def test_a_view_is_the_projection_times_the_averaged_strip() -> None:
    learned = LearnPrincipalComponents(components=10, headings=1).step(Context("m"), [averaged(p) for p in PICTURES])
    expected = learned.projection.components @ averaged(PICTURES[0]).values
    assert projected(PICTURES[0], learned.projection).values == pytest.approx(expected, rel=1e-4, abs=1e-4)


def test_a_projection_for_other_strips_is_refused() -> None:
    other = Projection(np.ones((2, 100), np.float32), np.ones(2))
    with pytest.raises(BadInput, match="strips of 100 numbers, the present ones have 144"):
        projected(PICTURES[0], other)
