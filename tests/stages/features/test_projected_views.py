"""Views by principal components, against numpy's singular vectors and against turned strips."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.features.averaged import AveragedView
from omninav.stages.features.pca import PrincipalComponents
from omninav.stages.mapping.principal_components import LearnPrincipalComponents, principal_components
from omninav.stages.mapping.supervised_views import SupervisedViews
from omninav.stages.values.image import Panorama
from omninav.stages.values.pose import Pose
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


def test_components_are_the_right_singular_vectors_of_the_centred_pictures() -> None:
    pictures = RNG.normal(size=(9, 24)).astype(np.float32) * np.linspace(5, 1, 24, dtype=np.float32)
    rows, explained = principal_components(pictures, 4)
    _, singular, vectors = np.linalg.svd(pictures - pictures.mean(axis=0), full_matrices=False)
    assert np.abs(np.sum(rows * vectors[:4], axis=1)) == pytest.approx(np.ones(4), abs=1e-6)
    assert explained == pytest.approx(singular[:4] ** 2 / (singular**2).sum(), rel=1e-5)
    assert rows @ rows.T == pytest.approx(np.eye(4), abs=1e-9)
    assert (rows[np.arange(4), np.abs(rows).argmax(axis=1)] > 0).all()


def test_learning_from_turned_copies_is_learning_from_each_written_out() -> None:
    pictures = RNG.normal(size=(5, 24)).astype(np.float32)
    all_turned = np.concatenate([np.roll(pictures, 4 * turn, axis=1) for turn in range(6)])
    rows, explained = principal_components(pictures, 24, 6)
    _, written = principal_components(all_turned, 24)
    assert explained == pytest.approx(written[: len(explained)], rel=1e-5, abs=1e-7)
    assert rows @ rows.T == pytest.approx(np.eye(len(rows)), abs=1e-9)


def test_no_more_components_are_kept_than_there_is_to_tell_apart() -> None:
    rows, explained = principal_components(RNG.normal(size=(4, 24)).astype(np.float32), 20)
    assert len(rows) == 3
    assert explained.sum() == pytest.approx(1.0)


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


def test_a_supervised_map_has_each_view_at_its_true_pose() -> None:
    views = [averaged(picture) for picture in PICTURES[:3]]
    projection = Projection(np.eye(5, 144, dtype=np.float32), np.ones(5))
    stage, context = SupervisedViews(sigma_m=0.5, sigma_deg=90.0), Context("mapping")
    made = stage.step(context, views, [Pose(1.0, 2.0, 3.0), None, Pose(4.0, 5.0, -3.0)], projection).map
    assert made.means.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, -3.0]]
    assert made.covariances[0] == pytest.approx(np.diag([0.25, 0.25, math.pi**2 / 4]))
    assert made.views == pytest.approx(np.stack([views[0].values[:5], views[2].values[:5]]))
    assert (made.kind, made.pose_source, made.weights.tolist()) == ("Coefficients", "truth", [1.0, 1.0])
    assert context.counts["view_without_pose"] == 1
    with pytest.raises(BadInput, match="no ground truth"):
        stage.step(context, views, [None] * 3)
