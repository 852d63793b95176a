"""Points as a file that other programs open."""

from omninav.stages.geometry.arrays import Array, Floats


def ply(points: Floats | Array) -> bytes:
    """Points (N, 3) as a binary PLY file (Turk 1994) of vertices alone."""
    header = (
        f"ply\nformat binary_little_endian 1.0\nelement vertex {len(points)}\n"
        "property double x\nproperty double y\nproperty double z\nend_header\n"
    )
    return header.encode() + points.astype("<f8").tobytes()
