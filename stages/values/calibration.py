"""Relation of similarity and place that a map's own views show."""

from typing import Annotated

from omninav.pipeline import Bounds, Value


class SimilarityCalibration(Value):
    """Relation of a view's similarity to a reference and the likelihood ratio of the right against a wrong place.

    The logarithm of the ratio is `slope` (z - `middle`), saturated at both ends; z is log S in standard deviations
    from the mean over the references at their best headings, so that light or a day that lowers all similarities
    changes nothing. `images`: left-out images that it was learned on; no ratio above their number can be shown by
    them. `right_distance_m`: the distance up to which a reference was the right place. `correlation_m`: the distance
    driven over which the evidence of a view for its place loses its correlation.
    """

    slope: Annotated[float, Bounds(ge=0)]
    middle: float
    images: Annotated[int, Bounds(ge=1)]
    right_distance_m: Annotated[float, Bounds(gt=0)]
    correlation_m: Annotated[float, Bounds(gt=0)]
