"""Evidence of a single image for or against the estimate."""

from typing import Annotated

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array

Metres = Annotated[float, Bounds(ge=0)]


class MatchLeads(Value):
    """The best match of an image, and by how much it leads others, in standard deviations of the similarity over the
    compared references."""

    place: Annotated[Array, Shape(3)]
    """Pose of a robot that sees the best match (m, rad)."""
    over_elsewhere: Annotated[float, Bounds(ge=0)]
    """Lead over the best match elsewhere, 0 where all show one place."""
    over_estimate: Annotated[float, Bounds(ge=0)]
    """Lead over the best match near the estimate, 0 where none was compared there."""


class ImageEvidence(Value):
    """One image beside the estimate; None where it, or the map, has nothing to measure it by."""

    nearest_m: Metres | None = None
    """Distance from the estimate to the nearest reference of the map (m)."""
    nearest_scales: Metres | None = None
    """The same in appearance length scales of the map."""
    match_away_m: Metres | None = None
    """Distance from the estimate to the place of the image's best match (m)."""
    match_lead: Metres | None = None
    """Lead of the best match over the best one elsewhere, in standard deviations of the similarity over the map."""
    lead_against: Metres | None = None
    """Its lead over the best one near the estimate, in the same unit."""
    landmarks: Annotated[int, Bounds(ge=0)] | None = None
    """Landmarks that agree on one pose; 0: too few for any."""
    landmarks_away_m: Metres | None = None
    """Distance from the estimate to that pose (m)."""
    features: Annotated[int, Bounds(ge=0)] | None = None
    """Features in which landmarks were looked for."""
    brightness: Annotated[float, Bounds(ge=0, le=1)] | None = None
    """Mean grey of the panorama, 1 is white."""
    contrast: Annotated[float, Bounds(ge=0, le=1)] | None = None
    """Standard deviation of the grey of parts of the panorama, 1 is white."""
    correlation: Annotated[float, Bounds(ge=-1.01, le=1.01)] | None = None
    """Correlation with the image before at the turn where it is highest, 1: the same image."""
    conflict: str = ""
    """The first finding that holds of inputs that do not fit each other."""
