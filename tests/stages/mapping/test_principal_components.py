"""Principal components of images, against numpy's singular vectors and by hand."""

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.mapping.principal_components import LearnPrincipalComponents, principal_components
from omninav.stages.values.views import Coefficients

RNG = np.random.default_rng(11)


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


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
def test_no_more_components_are_kept_than_there_is_to_tell_apart(scale: float) -> None:
    rows, explained = principal_components(scale * RNG.normal(size=(4, 24)).astype(np.float32), 20)
    assert len(rows) == 3
    assert explained.sum() == pytest.approx(1.0)


def test_components_of_images_along_one_line_are_its_direction() -> None:
    # (0, 0), (3, -4), (6, -8): all variance is along (3, -4) / 5; its largest number is made positive.
    rows, explained = principal_components(np.array([[0, 0], [3, -4], [6, -8]], np.float32), 2)
    assert rows == pytest.approx(np.array([[-0.6, 0.8]]))
    assert explained == pytest.approx([1.0])
    # Across it another, a quarter as far: (0, 0) with (8, 6) added and taken off, 2 x 100 against 2 x 25.
    rows, explained = principal_components(np.array([[8, 6], [-8, -6], [3, -4], [-3, 4]], np.float32), 1)
    assert rows == pytest.approx(np.array([[0.8, 0.6]]))
    assert explained == pytest.approx([0.8])


def test_turned_copies_are_centred_on_the_mean_of_all_of_them() -> None:
    # A single image (1, 3) of two headings: its copies are (1, 3) and (3, 1), their mean (2, 2).
    rows, explained = principal_components(np.array([[1.0, 3.0]], np.float32), 2, 2)
    assert np.abs(rows) == pytest.approx(np.array([[0.5**0.5, 0.5**0.5]]))
    assert rows[0].sum() == pytest.approx(0.0)
    assert explained == pytest.approx([1.0])
    # Two channels: a turn moves both, and the mean is one for each.
    rows, _ = principal_components(np.array([[1.0, 50.0, 3.0, 60.0]], np.float32), 4, 2)
    assert rows * np.sign(rows[0, 3]) == pytest.approx(np.array([[-1.0, -5.0, 1.0, 5.0]]) / 52**0.5)


@pytest.mark.parametrize(("headings", "share"), [(1, 1.0), (36, None)])
def test_the_stage_learns_from_all_views_and_says_what_they_explain(headings: int, share: float | None) -> None:
    images = RNG.normal(size=(4, 72)).astype(np.float32)
    ctx = Context("projection")
    stage = LearnPrincipalComponents(components=3, headings=headings)
    learned = stage.step(ctx, [Coefficients(image, image[None]) for image in images]).projection
    rows, explained = principal_components(images, 3, headings)
    np.testing.assert_array_equal(learned.components, rows.astype(np.float32))
    np.testing.assert_array_equal(learned.explained, explained)
    assert ctx.facts["explained_variance"] == round(float(explained.sum()), 4)
    assert share is None or ctx.facts["explained_variance"] == share


def test_by_itself_it_learns_128_components_from_36_headings() -> None:
    images = RNG.normal(size=(5, 180)).astype(np.float32)
    learned = LearnPrincipalComponents().step(Context("p"), [Coefficients(i, i[None]) for i in images]).projection
    np.testing.assert_array_equal(learned.components, principal_components(images, 128, 36)[0].astype(np.float32))
    assert len(learned.components) == 128
