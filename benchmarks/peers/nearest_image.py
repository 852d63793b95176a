"""The pose of the map's most similar image: small colour panoramas at every turn (OpenCV and numpy).

omninav variant=peer command="python benchmarks/peers/nearest_image.py" tour=tour.mcap log=drive.mcap
"""

import numpy as np
from given import FOLDER, localise, similarities, small_panoramas, the_map

files, poses = the_map()
small = small_panoramas(columns=72, rows=12)
spectra = np.fft.rfft([small(file) for file in files], axis=2)
np.save(FOLDER / "map.npy", spectra.astype(np.complex64))


def pose_of(file, motion):
    found = similarities(spectra, small(file))
    best, turn = np.unravel_index(found.argmax(), found.shape)
    return (*poses[best, :2], poses[best, 2] - 2 * np.pi * turn / found.shape[1])


localise(pose_of)
