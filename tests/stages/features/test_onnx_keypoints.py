"""A network of the user's own finds points, and a robot finds its way by the landmarks that they become."""

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from turned_robot import CAMERA, both_kinds, look, wrapped

from omninav.pipeline import BadInput, Context
from omninav.pipeline.cli.main import main
from omninav.stages.features.onnx_keypoints import OnnxKeypoints, signed_as_bytes
from omninav.stages.features.rotation_reduced_sift import SEAM
from omninav.stages.geometry.appearance.feature_matching import Pairs, mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.values.image import Panorama
from omninav.stages.values.local_features import LocalFeatures

onnx = pytest.importorskip("onnx")
DATA = Path(__file__).parents[2] / "data"
GRID = 8
"""Samples of a patch across and down."""
NAMES = ("keypoints", "scores", "descriptors")


def gaussian(sigma: float, radius: int = 4) -> np.ndarray:
    steps = np.exp(-(np.arange(-radius, radius + 1) ** 2) / (2 * sigma**2))
    return (np.outer(steps, steps) / steps.sum() ** 2).astype(np.float32)[None, None]


def network(
    path: Path,
    names: tuple[str, ...] = NAMES,
    batch: bool = False,
    across: bool = False,
    sides: tuple = ("rows", "columns"),
    channels: int = 1,
    spoilt: float = 1.0,
) -> Path:
    """Corners, local maxima of Förstner's measure, described by grey values around them less their mean.

    `batch`: outputs have a first axis of 1; `across`: a descriptor is a column; `spoilt`: multiplies the scores.
    """
    make, constants, nodes = onnx.helper, {}, []

    def add(operator: str, inputs: str, name: str, *values: object, **settings: object) -> None:
        more = [f"{name}_{n}" for n in range(len(values))]
        constants.update(zip(more, map(np.asarray, values), strict=True))
        nodes.append(make.make_node(operator, [*inputs.split(), *more], [name], **settings))

    def convolve(image: str, name: str, weights: np.ndarray) -> None:
        add("Conv", image, name, weights.astype(np.float32), pads=[weights.shape[2] // 2, weights.shape[3] // 2] * 2)

    convolve("image", "grey", np.full((1, channels, 1, 1), 1.0 / channels))
    convolve("grey", "fine", gaussian(1.0))
    convolve("fine", "x", np.array([[[[-1.0, 0.0, 1.0]]]]))
    convolve("fine", "y", np.array([[[[-1.0], [0.0], [1.0]]]]))
    for one, other in ("xx", "yy", "xy"):
        add("Mul", f"{one} {other}", f"{one}{other}_each")
        convolve(f"{one}{other}_each", one + other, gaussian(1.5))
    for operator, inputs, name in (
        ("Mul", "xx yy", "both"),
        ("Mul", "xy xy", "crossed"),
        ("Sub", "both crossed", "determinant"),
        ("Add", "xx yy", "trace"),
    ):
        add(operator, inputs, name)
    add("Add", "trace", "positive", np.float32(1e-6))
    add("Div", "determinant positive", "strength")
    add("MaxPool", "strength", "strongest", kernel_shape=[5, 5], pads=[2] * 4)
    add("GreaterOrEqual", "strength strongest", "highest")
    add("Greater", "strength", "corner", np.float32(1e-6))
    add("And", "highest corner", "chosen")
    add("NonZero", "chosen", "transposed")
    add("Transpose", "transposed", "places", perm=[1, 0])
    add("GatherND", "strength places", "unspoilt")
    add("Mul", "unspoilt", "strengths", np.float32(spoilt))
    add("Gather", "places", "found", np.array([3, 2]), axis=1)
    samples = np.zeros((GRID**2, 1, 2 * GRID + 1, 2 * GRID + 1))
    for n in range(GRID**2):
        samples[n, 0, 2 * (n // GRID) + 1, 2 * (n % GRID) + 1] = 1.0
    convolve("grey", "coarse", gaussian(1.5))
    convolve("coarse", "patches", samples)
    add("Transpose", "patches", "patches_last", perm=[0, 2, 3, 1])
    add("Gather", "places", "pixels", np.array([0, 2, 3]), axis=1)
    add("GatherND", "patches_last pixels", "raw")
    add("ReduceMean", "raw", "mean", axes=[1])
    add("Sub", "raw mean", "signed")
    if across:
        add("Transpose", "signed", "columns", perm=[1, 0])
    kinds = onnx.TensorProto
    outputs = []
    for inner, name, type, shape in zip(
        ("found", "strengths", "columns" if across else "signed"),
        names,
        (kinds.INT64, kinds.FLOAT, kinds.FLOAT),
        (["N", 2], ["N"], [GRID**2, "N"] if across else ["N", GRID**2]),
        strict=True,
    ):
        add("Unsqueeze" if batch else "Identity", inner, name, *([np.array([0])] if batch else []))
        outputs.append(make.make_tensor_value_info(name, type, [1] * batch + shape))
    image = make.make_tensor_value_info("image", kinds.FLOAT, [1, channels, *sides])
    weights = [onnx.numpy_helper.from_array(values, name) for name, values in constants.items()]
    graph = make.make_graph(nodes, "corners", [image], outputs, weights)
    model = make.make_model(graph, opset_imports=[make.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.save(model, path)
    return path


def found(model: Path, kind: str = "mirror", heading: float = 0.0, **parameters: int) -> LocalFeatures:
    stage, context = OnnxKeypoints(model=str(model), **parameters), Context("points")
    stage.setup(context)
    features = stage.step(context, image=look(kind, heading), camera=CAMERA).features
    assert isinstance(features, LocalFeatures)
    return features


def matched(one: LocalFeatures, other: LocalFeatures) -> Pairs:
    return mutual_nearest_units(root_descriptors(one.descriptors), root_descriptors(other.descriptors), 0.8)


@both_kinds
def test_a_robot_that_turns_sees_the_same_points_turned_the_other_way(kind: str, tmp_path: Path) -> None:
    model = network(tmp_path / "net.onnx")
    one, other = found(model, kind), found(model, kind, 2.9)
    pairs = matched(one, other)
    azimuths = [np.arctan2(each.bearings[:, 1], each.bearings[:, 0]) for each in (one, other)]
    off = np.abs(wrapped(azimuths[1][pairs.second] - azimuths[0][pairs.first] + 2.9))
    assert len(off) > 100
    assert (off < math.radians(1.0)).mean() > 0.9


def test_points_lie_on_corners_of_the_image_as_it_was_taken(tmp_path: Path) -> None:
    features = found(network(tmp_path / "net.onnx"))
    grey = cv2.GaussianBlur(cv2.cvtColor(look("mirror", 0.0).pixels, cv2.COLOR_BGR2GRAY), (0, 0), 1.5)
    corners = cv2.dilate(cv2.cornerMinEigenVal(grey, 5), np.ones((3, 3), np.uint8))
    columns, rows = np.rint(features.points).astype(int).T
    shown = np.isfinite(CAMERA.unproject(CAMERA.grid())[0]).all(axis=2)
    assert np.median(corners[rows, columns]) > np.quantile(corners[shown], 0.85)


def test_names_or_shapes_tell_the_outputs_apart(tmp_path: Path) -> None:
    plain = found(network(tmp_path / "net.onnx"))
    for others in (
        {"batch": True, "across": True, "names": ("mkpts", "keypoint_scores", "feats")},
        {"names": ("a", "b", "c")},
        {"names": ("score", "scores", "scored"), "batch": True, "across": True},
    ):
        other = found(network(tmp_path / "other.onnx", **others))
        np.testing.assert_array_equal(other.points, plain.points)
        np.testing.assert_array_equal(other.descriptors, plain.descriptors)


def test_an_image_is_made_as_small_as_the_network_takes_it_and_has_colours_where_it_asks_for_them(
    tmp_path: Path,
) -> None:
    top, bottom = CAMERA.elevations
    columns = 480 - 2 * SEAM
    free = found(network(tmp_path / "free.onnx"), max_pixels=int(columns**2 * (top - bottom) / math.tau))
    fixed = found(network(tmp_path / "fixed.onnx", sides=(240, 480), channels=3))
    pairs = matched(free, fixed)
    cosines = np.einsum("ij,ij->i", free.bearings[pairs.first], fixed.bearings[pairs.second])
    assert len(cosines) > 50
    assert (cosines > math.cos(math.radians(1.0))).mean() > 0.9


def test_the_strongest_points_are_kept_in_their_order(tmp_path: Path) -> None:
    model = network(tmp_path / "net.onnx")
    few, more = found(model, max_features=20), found(model, max_features=40)
    np.testing.assert_array_equal(few.points, more.points[:20])


def test_an_image_of_one_colour_has_no_points_and_descriptors_of_the_same_length(tmp_path: Path) -> None:
    stage, context = OnnxKeypoints(model=str(network(tmp_path / "net.onnx"))), Context("points")
    stage.setup(context)
    features = stage.step(context, image=Panorama(np.full((64, 256, 3), 90, np.uint8))).features
    assert features.descriptors.shape == (0, 2 * GRID**2)


@pytest.mark.parametrize("length", [64, 128, 256])
def test_signed_descriptors_match_as_bytes_as_they_do_themselves(length: int) -> None:
    rng = np.random.default_rng(length)
    seen, noise, rest = (rng.standard_normal((400, length)).astype(np.float32) for _ in range(3))
    one, other = np.concatenate([seen, rest[:100]]), np.concatenate([seen + 0.6 * noise, rest[100:]])
    exact = mutual_nearest_units(*(rows / np.linalg.norm(rows, axis=1)[:, None] for rows in (one, other)), 0.8)
    roots = [root_descriptors(signed_as_bytes(rows)) for rows in (one, other)]
    pairs = mutual_nearest_units(*roots, 0.8)
    both = set(zip(exact.first, exact.second, strict=True)) & set(zip(pairs.first, pairs.second, strict=True))
    assert len(both) > 0.97 * max(len(exact.first), len(pairs.first))
    cosines = np.sum(one[:400] * other[:400], axis=1) / np.prod(
        np.linalg.norm([one[:400], other[:400]], axis=2), axis=0
    )
    assert np.corrcoef(cosines, np.sum(roots[0][:400] * roots[1][:400], axis=1))[0, 1] > 0.95


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"channels": 2}, r"its input is .\[1, 2, .*expected one image of float32"),
        ({"sides": (64, 64)}, "its images are 64 x 64, expected 192 to 4096 pixels a side"),
        ({"spoilt": math.nan}, "keypoints, scores or descriptors that are not finite"),
        ({"names": ("scores", "keypoints", "descriptors")}, r"are \[\d+\], \[\d+, 2\].*expected keypoints \[N, 2\]"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path: Path, settings: dict, said: str) -> None:
    with pytest.raises(BadInput, match=said) as refused:
        found(network(tmp_path / "net.onnx", **settings))
    assert "\n" not in str(refused.value)


def test_a_network_without_keypoints_and_one_that_fails_are_said_to_be(tmp_path: Path) -> None:
    for spoil, said in (
        (lambda graph: graph.output.pop(0), r"its outputs are .*expected keypoints"),
        (
            lambda graph: next(node for node in graph.node if "signed" in node.output).input.__setitem__(1, "unspoilt"),
            "the network cannot run on an image",
        ),
    ):
        model = onnx.load(network(tmp_path / "net.onnx"))
        spoil(model.graph)
        onnx.save(model, tmp_path / "net.onnx")
        with pytest.raises(BadInput, match=said):
            found(tmp_path / "net.onnx")


def test_a_robot_finds_its_way_by_landmarks_of_a_network(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    of_house = f"tour={DATA / 'tour.mcap'}", f"log={DATA / 'drive.mcap'}", "nodes.source.stop=10", "plots=none"
    code = main(["variant=omninav", *of_house, "landmarks=onnx", f"model={network(tmp_path / 'net.onnx')}"])
    assert code == 0, capsys.readouterr().err
    metrics = json.loads((tmp_path / "runs/latest/metrics.json").read_text())
    assert metrics["position_error_m"]["median"] < 0.05
