"""Affine-invariant features: found in tilted images, at points of the image itself."""

import numpy as np
from turned_robot import CAMERA, look

from omninav.pipeline import Context
from omninav.stages.features.affine_sift import AffineSift
from omninav.stages.features.rotation_reduced_sift import RotationReducedSift


def test_features_of_tilted_images_are_found_beside_sifts_own() -> None:
    found = []
    for stage in (
        AffineSift(max_features=4000, max_pixels=20000),
        RotationReducedSift(orientation="own", max_features=4000, max_pixels=20000),
    ):
        context = Context("features")
        stage.setup(context)
        found.append(stage.step(context, image=look("mirror", 0.3), camera=CAMERA).features)
    affine, plain = found
    assert len(affine) > 2 * len(plain)
    gap = np.linalg.norm(affine.points[:, None] - plain.points[None], axis=2).min(axis=0)
    assert (gap < 0.5).mean() > 0.9
    nearest = np.linalg.norm(affine.points[:, None] - plain.points[None], axis=2).argmin(axis=0)
    apart = np.linalg.norm(affine.descriptors[nearest].astype(float) - plain.descriptors, axis=1)
    assert np.median(apart) < 50.0
