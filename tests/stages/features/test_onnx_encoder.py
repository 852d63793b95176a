"""A network of the user's own describes views, and a map keeps what it says."""

import sys
from pathlib import Path

import numpy as np
import pytest

from omninav.pipeline import BadInput, Context
from omninav.pipeline.cli.main import main
from omninav.pipeline.graph.contents import violation
from omninav.stages.features.onnx_encoder import OnnxEncoder, encoder_input
from omninav.stages.values.features import SegmentDescriptors
from omninav.stages.values.image import Panorama

onnx = pytest.importorskip("onnx")
DATA = Path(__file__).parents[2] / "data"
PIXELS = np.random.default_rng(3).integers(0, 256, (20, 80, 3)).astype(np.uint8)


def network(path: Path, batch: object = "N", sides: tuple = (16, 16), last: bool = False) -> Path:
    """An encoder whose vector is the means of the channels; its other output is no vector."""
    helper, kind = onnx.helper, onnx.TensorProto.FLOAT
    shape = [batch, *sides, 3] if last else [batch, 3, *sides]
    axes = [1, 2] if last else [2, 3]
    node = helper.make_node("ReduceMean", ["image"], ["means"], axes=axes, keepdims=0)
    total = helper.make_node("ReduceSum", ["means"], ["total"], keepdims=0)
    graph = helper.make_graph(
        [node, total],
        "means",
        [helper.make_tensor_value_info("image", kind, shape)],
        [helper.make_tensor_value_info("means", kind, [batch, 3]), helper.make_tensor_value_info("total", kind, [])],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 13)])
    model.ir_version = 8
    onnx.save(model, path)
    return path


def after_means(path: Path, name: str, *constants: np.ndarray, **settings: object) -> Path:
    """The encoder of `network` with another operator behind it."""
    model = onnx.load(network(path))
    inputs = ["means"] if name != "RandomNormal" else []
    for number, values in enumerate(constants):
        model.graph.initializer.append(onnx.numpy_helper.from_array(np.asarray(values), f"c{number}"))
        inputs.append(f"c{number}")
    model.graph.node.append(onnx.helper.make_node(name, inputs, ["after"], **settings))
    model.graph.output.insert(0, onnx.helper.make_tensor_value_info("after", onnx.TensorProto.FLOAT, None))
    onnx.save(model, path)
    return path


def described(**parameters: object) -> np.ndarray:
    stage, ctx = OnnxEncoder(**parameters), Context("features")
    stage.setup(ctx)
    found = stage.step(ctx, panorama=Panorama(PIXELS)).features
    assert violation(found) is None
    return found.values


def test_each_part_of_the_panorama_gets_the_vector_that_the_network_gives(tmp_path: Path):
    plain = {"mean": (0.0, 0.0, 0.0), "deviation": (1.0, 1.0, 1.0)}
    found = described(model=str(network(tmp_path / "e.onnx")), segments=4, **plain)
    means = np.stack([PIXELS[:, n : n + 20].mean(axis=(0, 1))[::-1] for n in range(0, 80, 20)])
    np.testing.assert_allclose(found, means / np.linalg.norm(means, axis=1, keepdims=True), atol=2e-3)


def test_layout_order_of_colours_and_images_at_once_are_as_asked_for(tmp_path: Path):
    given = described(model=str(network(tmp_path / "e.onnx")))
    for model, parameters in (
        (network(tmp_path / "one.onnx", batch=1), {}),
        (network(tmp_path / "last.onnx", last=True), {"layout": "nhwc"}),
        (network(tmp_path / "free.onnx", sides=("rows", "columns")), {"size": (16, 16)}),
    ):
        np.testing.assert_allclose(described(model=str(model), **parameters), given, atol=1e-6)
    blue_first = described(model=str(tmp_path / "e.onnx"), channels="bgr", mean=(0, 0, 0), deviation=(1, 1, 1))
    red_first = described(model=str(tmp_path / "e.onnx"), mean=(0, 0, 0), deviation=(1, 1, 1))
    np.testing.assert_allclose(blue_first, red_first[:, ::-1], atol=1e-6)


def test_pixels_are_normalised_by_channel():
    white = np.full((4, 8, 3), 255, np.uint8)
    images = encoder_input(white, 2, (4, 4), "rgb", (0.5, 0.25, 0.0), (0.5, 0.25, 2.0))
    assert images.shape == (2, 4, 4, 3)
    np.testing.assert_allclose(images[0, 0, 0], [1.0, 3.0, 0.5])


@pytest.mark.parametrize(
    ("make", "parameters", "said"),
    [
        (lambda path: path, {}, "there is no file"),
        (lambda path: path.write_bytes(b"no network") and path, {}, "this is no network that onnxruntime can run"),
        (lambda path: path.write_bytes(b"\x0a\x08location\x12\x09elsewhere") and path, {}, "weights are in another"),
        (lambda path: network(path, last=True), {}, "write nodes.features.layout=nhwc"),
        (lambda path: network(path, sides=("h", "w")), {}, r"write nodes.features.size=\[224,224\]"),
        (network, {"size": (8, 8)}, "its images are 16 x 16; leave nodes.features.size out"),
        (lambda path: network(path, batch=3), {}, "write nodes.features.segments=3 or a multiple"),
        (lambda path: network(path, sides=(60_000, 3000)), {}, "8 images of 60000 x 3000 are too large"),
        (lambda path: after_means(path, "Div", np.float32(0)), {}, "vectors that are not finite"),
        (lambda path: after_means(path, "Slice", [0], [0], [1]), {}, r"'after' is \[8, 0\] of float32"),
        (lambda path: after_means(path, "Tile", [1, 400_000]), {}, "1,200,000 numbers, at most 1,048,576 are read"),
        (lambda path: after_means(path, "RandomNormal", shape=[8, 3]), {}, "RandomNormal, and so gives other vectors"),
        (lambda path: path.write_bytes(b'"\x04Loop') and path, {}, "Loop, and so may run for ever"),
        (network, {"output": "vector"}, "there is no output 'vector'; its outputs are: 'means, total'"),
        (network, {"output": "total"}, "expected one vector of floating-point numbers for each"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_line(tmp_path: Path, make, parameters: dict, said: str):
    with pytest.raises(BadInput, match=said) as refused:
        described(model=str(make(tmp_path / "e.onnx")), **parameters)
    assert "\n" not in str(refused.value)


def test_without_onnxruntime_it_says_what_to_install(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    with pytest.raises(BadInput, match=r"pip install 'omninav\[onnx\]'"):
        OnnxEncoder(model=str(network(tmp_path / "e.onnx"))).inputs_digest()


def test_a_descriptor_that_is_no_unit_vector_is_no_descriptor():
    wrong = violation(SegmentDescriptors(np.array([[3.0, 4.0]], np.float32)))
    assert wrong == "'values' holds a vector of length 5, expected 1"
    assert violation(SegmentDescriptors.of(np.array([[3.0, 4.0], [0.0, 0.0]]))) is None


@pytest.mark.parametrize("match", ["cosine", "selective"])
def test_a_variant_learns_its_map_with_a_network_and_finds_its_way(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], match: str
):
    monkeypatch.chdir(tmp_path)
    of_house = f"tour={DATA / 'tour.mcap'}", f"log={DATA / 'drive.mcap'}", "nodes.source.stop=10", "validate=true"
    model = network(tmp_path / "e.onnx")
    code = main(["variant=omniview_mcl", *of_house, "features=onnx", f"model={model}", f"match={match}"])
    assert (code, (tmp_path / "runs/latest/metrics.json").is_file()) == (0, True), capsys.readouterr().err


@pytest.mark.parametrize("stage", ["features", "landmarks"])
def test_without_a_model_it_says_what_to_type(capsys: pytest.CaptureFixture[str], stage: str):
    assert main(["check", f"{stage}=onnx"]) == 2
    assert "model=" in capsys.readouterr().err
