"""Learns the projection that keeps most of the variance of a tour's images."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.projection import Projection
from omninav.stages.values.views import Coefficients


def principal_components(images: Floats, number: int, headings: int = 1) -> tuple[Array, Array]:
    """Directions of greatest variance of images (N, P), and their shares of it: (D, P) orthonormal, (D,).

    With `headings` H > 1 over all H turned copies of each: an image runs column by column around the robot, a turn
    moves it by P / H. From the eigenvectors of the scatter matrix, which are the right singular vectors of the centred
    images. A direction's largest number is positive. D is `number`, or less where there is less to tell apart.
    """
    centred = images.astype(np.float64) - images.mean(axis=0, dtype=np.float64)
    if headings > 1:
        centred = images.astype(np.float64)
        ring = centred.reshape(len(images), headings, -1).mean(axis=(0, 1))  # the mean of all turned copies
        centred = centred - np.tile(ring, headings)
    scatter = centred.T @ centred
    step = images.shape[1] // headings
    scatter = sum(
        (np.roll(scatter, (step * h, step * h), axis=(0, 1)) for h in range(headings)), np.zeros_like(scatter)
    )
    variances, vectors = np.linalg.eigh(scatter)
    strongest = np.argsort(-variances, kind="stable")[:number]
    strongest = strongest[variances[strongest] > 1e-9 * variances.max()]
    rows = vectors[:, strongest].T
    largest = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)
    return rows * np.sign(largest), variances[strongest] / variances.sum()


class LearnPrincipalComponents(Stage):
    """Learns the principal components of a tour's averaged panoramas.

    Porta & Kröse 2004, section 2: the eigenvectors with the largest eigenvalues are the rows of the projection W.
    """

    components: Annotated[int, Bounds(ge=1)] = 128
    """Components; the paper does not give their number."""
    headings: Annotated[int, Bounds(ge=1)] = 36
    """Turns of each image that are learned from, so that the projection serves any heading; must divide the columns. 1:
    the images as they are, as in the paper."""

    class Out(Outputs):
        projection: Projection

    def step(self, ctx: Context, views: Sequence[Coefficients]) -> Out:
        rows, explained = principal_components(
            np.stack([view.values for view in views]), self.components, self.headings
        )
        ctx.fact("explained_variance", round(float(explained.sum()), 4))
        return self.Out(projection=Projection(rows.astype(np.float32), explained))
