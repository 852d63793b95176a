"""Points as a file that other programs open."""

from omninav.stages.geometry.arrays import Floats


def ply(points: Floats) -> bytes:
    """Points (N, 3) as a binary PLY file (Turk 1994) of vertices alone."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    return header.encode() + points.astype("<f4").tobytes()
