"""The pose at which a view was taken, from ground truth or odometry."""

from typing import Literal

from omninav.pipeline import BadInput, Context, counted
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import OWN_FRAMES, SOURCE_WORDS, Pose, PoseSource, frame_of

Supervised = Literal["auto", "truth", "odometry"]
FEW_VIEWS = 5
"""Views up to which a map tells of one place only."""


def warn_of_few(ctx: Context, views: int) -> None:
    """Warn of a finished map of so few views that no robot is found by it."""
    if views <= FEW_VIEWS:
        has = f"has {counted(views, 'view')}, and a robot is found near those only"
        ctx.warn(f"mapping: the map {has}; drive a tour of all places, an image every 0.5 m")


def pose_of_view(
    ctx: Context, odometry: Pose | None, truth: Pose | None, map: ReferenceGraph, supervised: Supervised
) -> Pose | None:
    """The pose to store with a view; None, and counted, where there is none.

    The first view settles the source for the whole map: truth where there is any and `supervised` is not odometry.
    Raises BadInput where `supervised` is truth and there is none, and where a second log follows one whose poses are
    odometry.
    """
    if ctx.tick.first_of_log and ctx.tick.log and len(map) and map.pose_source in OWN_FRAMES:
        raise BadInput(
            "mapping: each log's odometry has a frame of its own, so several logs without ground truth make no "
            "one map; learn a map of each tour, and type: omninav map join one.omap other.omap out=both.omap"
        )
    if not len(map):
        known = truth is not None and supervised != "odometry"
        source: PoseSource = "truth" if known else frame_of(odometry)
        if supervised == "truth" and truth is None:
            raise BadInput(
                "mapping: the tour has no ground truth for its first image; "
                "use a tour with /ground_truth/pose, or nodes.mapping.supervised=auto"
            )
        map.put(pose_source=source)
        ctx.fact("map_poses", source)
    elif truth is not None and map.pose_source != "truth" and supervised == "auto":
        ctx.warn(
            "mapping: the first image of the tour has no ground truth and later ones do, so the map is in odometry's "
            "frame; begin the tour where they begin, or give true poses of all images: tour_settings.truth=FILE"
        )
    pose = truth if map.pose_source == "truth" else odometry
    if pose is None:
        ctx.count("view_without_pose", detail=f"mapping: images without {SOURCE_WORDS[map.pose_source]} are not mapped")
    return pose
