"""A user's own neural network, an ONNX file that onnxruntime runs in one thread."""

import re
from pathlib import Path
from typing import Any

from omninav.pipeline import BadInput, digest_file, digest_text, read_small

MAX_MODEL_BYTES = 1 << 30
"""Largest accepted model file, bytes."""
WEIGHTS_ELSEWHERE = b"\x0a\x08location\x12"
"""Bytes by which an ONNX file (as protobuf writes it) names a file of weights. No hash would cover that one."""
LOOPS, RANDOM = (
    ("Loop",),
    ("Bernoulli", "Multinomial", "RandomNormal", "RandomNormalLike", "RandomUniform", "RandomUniformLike"),
)
REFUSED = re.compile(b"|".join(b"\x22%c%s" % (len(name), name.encode()) for name in (*LOOPS, *RANDOM)))
"""Operators, as protobuf writes their names: with a loop a network may never end, and not even Ctrl-C stops it."""


def network_digest(model: str | None) -> str:
    """The digest of a network's file, and of the version that runs it. Raises BadInput."""
    return digest_text(digest_file(_file(model)), str(_runtime().__version__))


def _file(model: str | None) -> Path:
    if model is None or not Path(model).is_file():
        raise BadInput(f"model: there is no file {model or ''}; type model=NETWORK.onnx")
    return Path(model)


def _runtime() -> Any:
    try:
        import onnxruntime
    except ImportError:
        raise BadInput("a network needs onnxruntime, which is not installed; pip install 'omninav[onnx]'") from None
    return onnxruntime


def loaded(model: str | None) -> Any:
    """The network of a file, as onnxruntime's session that runs in one thread. Raises BadInput."""
    path = _file(model)
    runtime, content = _runtime(), read_small(path, MAX_MODEL_BYTES)
    if WEIGHTS_ELSEWHERE in content:
        raise BadInput(f"{path}: its weights are in another file; save them in this one: onnx.save(onnx.load(…), …)")
    found = REFUSED.search(content)
    if found is not None:
        name = found[0][2:].decode()
        why = "may run for ever" if name in LOOPS else "gives other vectors each time"
        raise BadInput(f"{path}: it has the operator {name}, and so {why}; expected a network without it")
    options = runtime.SessionOptions()
    options.intra_op_num_threads = options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 4
    try:
        return runtime.InferenceSession(content, options, providers=["CPUExecutionProvider"])
    except Exception as error:  # onnxruntime's errors are of no common class of its own
        raise BadInput(f"{path}: this is no network that onnxruntime can run: {error_line(error)}") from None


def error_line(error: Exception) -> str:
    """Message of onnxruntime, which may name what is in the file."""
    return " ".join("".join(c if c.isprintable() else " " for c in str(error)[:200]).split())
