"""omninav: localisation, mapping and navigation with an omnidirectional camera, as typed stages in a dataflow graph."""

import os

os.environ.setdefault("OPENCV_IO_MAX_IMAGE_PIXELS", "100000000")  # read as OpenCV is loaded: none larger is decoded
