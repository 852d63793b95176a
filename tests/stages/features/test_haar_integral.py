import math

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.features.haar_integral import Binning, HaarIntegral
from omninav.stages.geometry.appearance.haar_integrals import Kernel
from omninav.stages.match.retrieval import normalised_intersections
from omninav.stages.values.image import Panorama, Pixels, Windows


def a_scene(rows: int = 120, columns: int = 160, seed: int = 0) -> Pixels:
    """Coloured shapes of some ten pixels on a shaded ground: what a picture of a room is like, at any size."""
    rng = np.random.default_rng(seed)
    size = 8 * max(rows, columns)
    scene = np.full((size, size, 3), 120, np.uint8)
    for _ in range(size * size // 900):
        x, y, w, h = rng.integers(0, size, 2).tolist() + rng.integers(12, 50, 2).tolist()
        colour = rng.integers(20, 236, 3).tolist()
        if rng.random() < 0.5:
            cv2.rectangle(scene, (x, y), (x + w, y + h), colour, -1)
        else:
            cv2.circle(scene, (x, y), w // 2, colour, -1)
    return cv2.GaussianBlur(scene, (5, 5), 1.2)


def cut(scene: Pixels, rows: int, columns: int, x: float = 0.0, y: float = 0.0, angle: float = 0.0, zoom: float = 1.0):
    """A picture of the scene around its middle moved by (x, y), turned by an angle (degrees) and magnified."""
    size = scene.shape[0]
    to = cv2.getRotationMatrix2D((size / 2 + x, size / 2 + y), angle, zoom)
    to[:, 2] += np.array([columns / 2 - size / 2 - x, rows / 2 - size / 2 - y])
    return cv2.warpAffine(scene, to, (columns, rows), flags=cv2.INTER_AREA if zoom < 1 else cv2.INTER_LINEAR)


def window(*pixels: Pixels) -> Windows:
    return Windows(np.stack(pixels), np.linspace(0, 2 * np.pi, len(pixels), endpoint=False), 1.0)


def described(pixels: Pixels, **parameters) -> np.ndarray:
    return HaarIntegral(**parameters).step(Context("features"), window(pixels)).features.values


def similarity(one: np.ndarray, other: np.ndarray, scales: int = 1) -> float:
    return float(normalised_intersections(other[None], one[None], scales)[0, 0])


def plain_means(pixels: Pixels, radii: tuple[float, float], angles: int, root: bool = False) -> np.ndarray:
    """Equation 4 word for word, with wrapped borders and +t: one pixel and one angle after the other."""
    rows, columns, _ = pixels.shape
    scaled = pixels.astype(np.float64) / 255.0

    def at(y: float, x: float) -> np.ndarray:
        top, left = math.floor(y), math.floor(x)
        down, right = y - top, x - left
        corners = [scaled[(top + i) % rows, (left + j) % columns] for i in (0, 1) for j in (0, 1)]
        weights = [(1 - down) * (1 - right), (1 - down) * right, down * (1 - right), down * right]
        return sum(w * corner for w, corner in zip(weights, corners, strict=True))

    means = np.zeros_like(scaled)
    for y in range(rows):
        for x in range(columns):
            for p in range(angles):
                phi = 2 * math.pi * p / angles
                one = at(y + radii[0] * math.sin(phi), x + radii[0] * math.cos(phi))
                other = at(y + radii[1] * math.cos(phi), x - radii[1] * math.sin(phi))
                means[y, x] += np.sqrt(one * other) if root else one * other
    return means / angles


def wrapped(pixels: Pixels, by: int) -> np.ndarray:
    return np.pad(pixels.astype(np.float32) / np.float32(255), ((by, by), (by, by), (0, 0)), mode="wrap")


@pytest.mark.parametrize("root", [False, True])
@pytest.mark.parametrize(("radii", "angles"), [((3.0, 4.0), 36), ((0.0, 1.5), 7), ((5.25, 2.0), 12)])
def test_the_means_are_equation_4_word_for_word(radii: tuple[float, float], angles: int, root: bool) -> None:
    pixels = np.random.default_rng(0).integers(0, 256, (14, 17, 3), dtype=np.uint8)
    kernel = Kernel(radii, angles, root=root)
    means = kernel.means(wrapped(pixels, kernel.margin + 1))
    assert np.allclose(means, plain_means(pixels, radii, angles, root), atol=2e-6)


@pytest.mark.parametrize("root", [False, True])
def test_single_pixels_get_the_means_that_the_whole_picture_has_there(root: bool) -> None:
    rng = np.random.default_rng(1)
    kernel = Kernel((3.0, 4.0), 16, root)
    picture = wrapped(rng.integers(0, 256, (20, 30, 3), dtype=np.uint8), kernel.margin + 1)
    rows, columns = rng.integers(0, 20, 50), rng.integers(0, 30, 50)
    assert np.allclose(kernel.means_at(picture, rows, columns), kernel.means(picture)[rows, columns], atol=1e-6)


@pytest.mark.parametrize("histogram", ["joint", "separate"])
@pytest.mark.parametrize("root", [False, True])
def test_a_turned_picture_is_as_similar_as_its_interpolation_allows(histogram: str, root: bool) -> None:
    scene = a_scene()
    parameters = {"histogram": histogram, "root": root, "bins": 8}
    query = described(cut(scene, 120, 120), **parameters)
    strangers = [similarity(query, described(cut(scene, 120, 120, *at), **parameters)) for at in ((400, 0), (0, 400))]
    # A quarter turn moves pixels onto pixels: it changes nothing at all.
    quarter = np.rot90(cut(scene, 120, 120)).copy()
    assert similarity(query, described(quarter, **parameters)) == pytest.approx(1.0, abs=1e-3)
    turned = similarity(query, described(cut(scene, 120, 120, angle=33.0), **parameters))
    # A turned square shows pi / 4 + ... of the other at least: corners differ, the rest is the same.
    assert turned > 0.85
    assert turned > max(strangers)


def test_a_picture_rolled_around_itself_changes_nothing_where_borders_wrap() -> None:
    picture = cut(a_scene(), 60, 80)
    rolled = np.roll(picture, (17, 29), axis=(0, 1))
    assert np.allclose(described(picture, borders="wrap"), described(rolled, borders="wrap"), atol=1e-6)


def test_a_part_of_a_view_is_found_whole_where_borders_are_left_out() -> None:
    scene = a_scene()
    whole = cut(scene, 120, 160)
    seen = np.zeros((1, 120, 160), np.bool_)
    seen[:, :, :80] = True
    part = Windows(whole[None], np.zeros(1), 1.0, seen)
    query = HaarIntegral().step(Context("features"), part).features.values
    # The paper's order: what the query holds is all in the whole view, and a part of that in the query.
    assert similarity(query, described(whole)) == pytest.approx(1.0, abs=1e-5)
    assert similarity(described(whole), query) == pytest.approx(float(query.sum() / described(whole).sum()), abs=1e-5)


def test_what_lies_outside_the_picture_counts_nowhere() -> None:
    values = described(cut(a_scene(), 120, 160))
    assert values.sum() == pytest.approx(112 * 152 / (120 * 160), abs=1e-5)
    assert described(cut(a_scene(), 120, 160), borders="wrap").sum() == pytest.approx(1.0, abs=1e-5)


def test_a_panorama_goes_on_around_the_circle_and_ends_above_and_below() -> None:
    picture = cut(a_scene(), 60, 160)
    stage = HaarIntegral(segments=8)
    one = stage.step(Context("features"), Panorama(picture)).features
    other = stage.step(Context("features"), Panorama(np.roll(picture, 40, axis=1))).features
    assert np.allclose(np.roll(one.values, 2, axis=0), other.values, atol=1e-6)
    assert np.allclose(one.values.sum(axis=1), 52 / 60, atol=1e-5)
    assert one.directions is None


def test_windows_are_described_one_by_one() -> None:
    scene = a_scene()
    pictures = [cut(scene, 60, 80), cut(scene, 60, 80, x=200.0)]
    features = HaarIntegral().step(Context("features"), window(*pictures)).features
    assert features.directions is not None
    assert np.array_equal(features.values, np.concatenate([described(picture) for picture in pictures]))


@given(st.lists(st.tuples(*[st.floats(0, 1, width=32)] * 3), min_size=1, max_size=20), st.integers(1, 6), st.booleans())
def test_bins_keep_mass_and_mean(values: list[tuple[float, float, float]], bins: int, joint: bool) -> None:
    points = np.array(values, np.float32)
    shares, _ = Binning(bins, joint).shares(points, np.ones(len(points), np.bool_))
    assert shares.sum() == pytest.approx(1.0)
    middles = (np.arange(bins) + 0.5) / bins
    inside = np.clip(points.astype(np.float64), middles[0], middles[-1])
    for c in range(3):
        if joint:
            along = shares.reshape(bins, bins, bins).sum(axis=tuple(axis for axis in range(3) if axis != c))
        else:
            along = 3.0 * shares[c * bins : (c + 1) * bins]
        # a value shared between two middles by its distance has its mean where it is
        assert float(along @ middles) == pytest.approx(float(inside[:, c].mean()), abs=1e-6)


@pytest.mark.parametrize(
    "several", [{}, {"kernels": ((3.0, 4.0), (0.0, 8.0))}, {"kernels": ((3.0, 4.0),) * 2, "scales": (1.0, 1.5, 2.0)}]
)
def test_the_said_error_of_random_integration_is_the_one_it_has(several: dict[str, object]) -> None:
    pictures, ctx = window(cut(a_scene(), 60, 80)), Context("features", np.random.default_rng(5))
    full = HaarIntegral(**several).step(ctx, pictures).features.values
    stage = HaarIntegral(integration="monte_carlo", samples=200, **several)
    gaps, said = [], []
    for _ in range(300):
        out = stage.step(ctx, pictures)
        gaps.append(float(np.square(out.features.values - full).sum()))
        assert out.metrics is not None
        said.append(out.metrics.values["haar_integral"]["standard_error"] ** 2)
    # 300 squared distances with a spread of about their mean: their average is good to about 3 x 6 percent.
    assert np.mean(said) == pytest.approx(np.mean(gaps), rel=0.2)


def test_random_integration_repeats_with_its_seed_and_full_integration_draws_nothing() -> None:
    pictures = window(cut(a_scene(), 60, 80))
    stage = HaarIntegral(integration="monte_carlo", samples=300)
    one, other, third = (
        stage.step(Context("features", np.random.default_rng(seed)), pictures).features.values for seed in (7, 7, 8)
    )
    assert one.tobytes() == other.tobytes()
    assert one.tobytes() != third.tobytes()
    ctx = Context("features")
    assert HaarIntegral().step(ctx, pictures).metrics is None
    assert not ctx.used_rng


def test_kernels_share_the_mass_and_scales_each_have_all_of_it() -> None:
    picture = cut(a_scene(), 60, 80)
    both = described(picture, kernels=((3.0, 4.0), (0.0, 2.0)), scales=(1.0, 2.0), borders="wrap").reshape(4, 512)
    assert np.allclose(both.sum(axis=1), 0.5, atol=1e-5)
    single = described(picture, kernels=((6.0, 8.0),), borders="wrap")[0]
    assert np.allclose(2 * both[2], single, atol=1e-6)


def test_a_picture_smaller_than_a_kernel_is_refused() -> None:
    with pytest.raises(BadInput, match=r"8 x 4 pixels is too small for a kernel of 4; write nodes.features.kernels"):
        described(np.zeros((4, 8, 3), np.uint8))


def test_no_kernels_and_no_scales_are_refused() -> None:
    with pytest.raises(ValueError, match=r"write kernels: \[\[3, 4\]\]"):
        HaarIntegral(kernels=())
    with pytest.raises(ValueError, match=r"write scales: \[1.0\]"):
        HaarIntegral(scales=())
