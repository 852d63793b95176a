"""Shows a drive frame by frame: the image, the best reference, and the belief over the map."""

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from omninav.pipeline import Context, PlotStage, Slide, counted
from omninav.pipeline.report.chart import Chart, Layer, broken
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.pose_errors import heading_errors_deg, position_errors
from omninav.stages.geometry.probability.gaussians import moments
from omninav.stages.geometry.probability.particles import weighted_moments
from omninav.stages.geometry.probability.reliability import ELLIPSE_95, squared_mahalanobis
from omninav.stages.values.belief import GaussianMixture, Particles, PlaceBelief
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.map_places import AnyMap, map_poses
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.similarity import RetrievedReferences
from omninav.stages.values.thumbnails import Thumbnails
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures

from . import homing_frames, landmark_matches
from .best_match_picture import first_seen, picture_of_reference, picture_of_view
from .drawing import extent_of
from .homing_snapshot import EncodedHomingView
from .landmark_matches import drawn_matches, match_facts
from .panorama_snapshot import EncodedPanorama
from .plan_chart import draw_surroundings, jumps, plan_chart
from .snapshot_times import even_frames
from .target_images import target_of

Shown = Particles | GaussianMixture | PlaceBelief
MAX_ANSWERS = 3
"""References of an answer that are shown at most."""
MAX_DOTS = 150
"""Particles that are drawn of a belief at most."""


class FrameByFrame(PlotStage):
    """Shows up to 60 frames of the last log, at even steps: the image, its best match and the belief.

    The reference (or place) of the map that looked most like the image is ringed; with `thumbnails` its image is
    below the robot's, turned as the robot is turned against it. Of a map that is learned on the way the image is one of
    the drive's own `panoramas`, by the map's `events`, and the ring is where the robot was when it saw it. Features
    that were matched to landmarks are marked where a snapshot holds them.

    With `answers` the most similar references of a database are there, each with the error of the pose that it means.
    With `homing` the image is the robot's own, with the features that it follows; the target view, the homing vector,
    the planned route and the robot's state are shown too. Gives nothing where there are no frames.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        snapshots: Sequence[EncodedPanorama | None],
        beliefs: Sequence[Shown | None] | None = None,
        map: AnyMap | None = None,
        thumbnails: Thumbnails | None = None,
        grid: OccupancyGrid | None = None,
        plan: FloorPlan | None = None,
        events: Sequence[ViewEvent | None] | None = None,
        panoramas: Sequence[EncodedPanorama | None] | None = None,
        homing: Sequence[EncodedHomingView | None] | None = None,
        progress: Sequence[PathProgress | None] | None = None,
        statuses: Sequence[DrivingStatus | None] | None = None,
        routes: Sequence[PlannedRoute | None] | None = None,
        answers: Sequence[RetrievedReferences | None] | None = None,
    ) -> PlotStage.Out:
        ticks = first_seen(events or ())
        last = drive.last_log
        shown = even_frames(int(last.frames[-1]) + 1) if len(last) else ()
        rows = [n for n, frame in enumerate(last.frames.tolist()) if frame in shown]
        if not rows:
            return self.Out()
        path = _path(last)
        chart = plan_chart(extent_of(path, last.estimate, map_poses(map), margin=0.05))
        _draw_base(chart, last, path, map, grid, plan)
        slides = []
        for n in rows:
            tick = int(last.row[n])
            layer, belief = chart.layer(), None if beliefs is None else beliefs[tick]
            spot, snapshot = _spot(last, n, map), snapshots[tick]
            seen = ticks.get(int(last.reference[n]))
            if seen is not None:
                spot = _pose_at(drive, seen)
            _draw_now(layer, belief, last, path, n, spot)
            photographs = [] if snapshot is None else [("image", drawn_matches(snapshot))]
            facts = _facts(last, n, belief, spot) + match_facts(snapshot)
            followed, route = _of(homing, tick), _of(routes, tick)
            if followed is not None:
                places = map if isinstance(map, TopologicalMap) else None
                goal, target = target_of(_of(progress, tick), route, places, drive.truth[0], thumbnails)
                photographs = homing_frames.images(followed, target)
                facts += homing_frames.facts(followed, _of(progress, tick), _of(statuses, tick))
                homing_frames.draw_vector(layer, last.truth[n], followed.vector, goal)
                if places is not None:
                    homing_frames.draw_route(layer, route, places)
            picture = None
            if photographs and seen is not None and panoramas is not None:
                picture = picture_of_view(panoramas[seen], last.reference_turn[n])
            elif photographs and last.reference[n] >= 0:
                picture = picture_of_reference(last.reference[n], last.reference_turn[n], map, thumbnails)
            if (found := _of(answers, tick)) is not None and photographs:
                photographs += _answers(found, last.truth[n], map, thumbnails)
            elif picture is not None:
                photographs.append(("best match in the map", picture))
            label = f"frame {int(last.frames[n])} · {last.seconds[n]:.1f} s"
            slides.append(Slide(label, layer.svg, tuple(photographs), tuple(facts)))
        words = [shown_frames(last.frames[rows].tolist(), len(last)), *_ellipses_held(last)]
        if beliefs is not None:
            chart.name("belief", "pink", "dot")
            chart.name("estimate, 95 % ellipse" if _doubted(last).any() else "estimate", "blue", "line")
        if (ticks or not isinstance(map, ViewMixtures)) and (last.reference >= 0).any():
            chart.name("best reference", "green", "ring")
        if homing is None:
            words += _what_images_show(snapshots[int(last.row[rows[0]])])
            if any(each is not None and each.points is not None for each in snapshots):
                words.append(landmark_matches.COLOURS)
        else:
            chart.name("homing vector", "orange")
            chart.name("target view, truly", "orange", "ring")
            words.append(homing_frames.COLOURS)
        if routes is not None:
            chart.name("planned route", "green")
        if isinstance(map, TopologicalMap) and thumbnails is not None:
            words.append("The map's images are as the camera took them.")
        return self.drawn(
            name="frame_by_frame",
            title="Frame by frame",
            caption=" ".join(words),
            content=chart.svg(),
            order=30,
            slides=tuple(slides),
        )


def _of(values: Sequence[Any] | None, tick: int) -> Any:
    return None if values is None else values[tick]


def shown_frames(shown: Sequence[int], frames: int) -> str:
    """Which of this many frames can be stepped to: `Every second frame is shown.`"""
    steps = {after - before for before, after in pairwise(shown)}
    if len(steps) != 1:
        return f"{len(shown)} of {counted(frames, 'frame')} can be stepped to."
    (step,) = steps
    nth = {1: "", 2: "second "}.get(step, f"{step}th ")
    return f"Every {nth}frame is shown."


def _what_images_show(snapshot: EncodedPanorama | None) -> list[str]:
    if snapshot is None:
        return []
    if not snapshot.headings:
        return ["Panoramas have forward in the middle and the robot's left on the left."]
    if len(snapshot.headings) == 1:
        return ["The camera's images."]
    headings = ", ".join(f"{math.degrees(heading):z.0f}°" for heading in snapshot.headings)
    return [f"Windows cut from the camera's images look, from left to right, to {headings} from forward."]


def _path(drive: Drive) -> Array:
    """The true path, without truth the estimated one, without estimates odometry alone."""
    if drive.has_truth:
        return drive.truth
    if known(drive.estimate).any():
        return drive.estimate
    alone = drive.odometry_alone()
    return drive.estimate if alone is None else alone


def _draw_base(
    chart: Chart, drive: Drive, path: Array, map: AnyMap | None, grid: OccupancyGrid | None, plan: FloorPlan | None
) -> None:
    draw_surroundings(chart, map, grid, plan)
    if drive.has_truth:
        chart.base.line(path, "ink", 1.6, opacity=0.6)
        chart.name("ground truth", "ink")
    else:
        estimated = known(drive.estimate).any()
        chart.base.line(broken(path, jumps(path)), "blue" if estimated else "orange", 1.2, opacity=0.6)
        if not estimated:
            chart.name("odometry alone", "orange")


def _draw_now(layer: Layer, belief: Shown | None, drive: Drive, path: Array, n: int, spot: Array | None) -> None:
    if isinstance(belief, Particles):
        step = max(1, -(-len(belief.poses) // MAX_DOTS))
        layer.dots(belief.poses[::step], "pink", 2.0, 0.75)
    elif isinstance(belief, PlaceBelief):
        layer.discs(belief.poses, 16 * np.sqrt(belief.probabilities), "pink", 0.75)
    elif belief is not None and len(belief):
        heavy = np.argsort(-belief.weights, kind="stable")[:40]
        share = np.clip(belief.weights[heavy] / belief.weights.max(), 0.15, 1.0)
        layer.ellipses(belief.means[heavy], belief.covariances[heavy], share, "pink")
    if spot is not None:
        layer.ring(spot, "green")
    layer.dart(path[n] if not known(drive.estimate).any() or drive.has_truth else np.full(3, np.nan), "ink")
    if _doubted(drive)[n]:
        one = slice(n, n + 1)
        layer.ellipses(drive.estimate[one], drive.covariance[one], np.array([0.5]), "blue", math.sqrt(ELLIPSE_95))
    layer.dart(drive.estimate[n], "blue")


def _doubted(drive: Drive) -> Bools:
    """Which estimates have a covariance that is not zero: (N,)."""
    spread = drive.covariance[:, 0, 0] + drive.covariance[:, 1, 1]
    return np.asarray(known(drive.estimate) & (np.nan_to_num(spread) > 0.0))


def _ellipses_held(drive: Drive) -> list[str]:
    squares = squared_mahalanobis((drive.estimate - drive.truth)[:, :2], drive.covariance[:, :2, :2])
    squares = squares[np.isfinite(squares)]
    if not len(squares):
        return []
    return [f"The 95 % ellipse holds {100 * (squares <= ELLIPSE_95).mean():.0f} % of the true positions."]


def _spot(drive: Drive, n: int, map: AnyMap | None) -> Array | None:
    """Place of the best reference. Views that may be forgotten have no one place."""
    reference = int(drive.reference[n])
    if map is None or isinstance(map, ViewMixtures) or not 0 <= reference < len(map):
        return None
    poses = map.poses[map.places] if isinstance(map, TopologicalMap) else map.poses
    spot: Array = poses[reference]
    return spot


def _answers(
    found: RetrievedReferences, truth: Array, map: AnyMap | None, thumbnails: Thumbnails | None
) -> list[tuple[str, bytes]]:
    """Captions and JPEG bytes of the most similar references, best first, with their errors where truth is known."""
    shown: list[tuple[str, bytes]] = []
    for reference, similarity, turn in zip(found.references, found.similarities, found.turns, strict=True):
        picture = picture_of_reference(int(reference), float(turn), map, thumbnails)
        if picture is None:
            continue
        words = [f"{100 * similarity:.0f} %"]
        if np.isfinite(truth).all():
            pose = (map_poses(map)[reference] + (0.0, 0.0, turn))[None]
            words.append(f"{position_errors(pose, truth[None])[0]:.1f} m")
            words.append(f"{heading_errors_deg(pose, truth[None])[0]:.0f}°")
        shown.append((f"match {len(shown) + 1}: {', '.join(words)}", picture))
        if len(shown) == MAX_ANSWERS:
            break
    return shown


def _pose_at(drive: Drive, tick: int) -> Array | None:
    """The true pose in a tick of any log, without truth the estimated one; None where neither is known."""
    poses = drive.truth if drive.has_truth else drive.estimate
    row = int(np.searchsorted(drive.row, tick))
    there = row < len(drive) and drive.row[row] == tick and known(poses[row : row + 1]).all()
    return poses[row] if there else None


def _spread_m(belief: Particles | GaussianMixture) -> float:
    """Standard deviation (m) of the distance from the belief's mean; NaN of an empty one."""
    if not len(belief.weights):
        return float("nan")
    if isinstance(belief, GaussianMixture):
        _, covariance, _ = moments(belief.means, belief.covariances, belief.weights)
    else:
        _, covariance = weighted_moments(belief.poses, belief.weights)
    return float(np.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0)))


def _facts(drive: Drive, n: int, belief: Shown | None, spot: Array | None) -> list[tuple[str, str]]:
    one = slice(n, n + 1)
    facts = []
    (metres,), (degrees,) = (
        errors(drive.estimate[one], drive.truth[one]) for errors in (position_errors, heading_errors_deg)
    )
    if np.isfinite(metres):
        facts.append(("error", f"{metres:.3f} m, {degrees:.1f}°"))
    if known(drive.estimate[one]).all():
        x, y, heading = drive.estimate[n]
        facts.append(("estimate", f"x {x:z.3f} m, y {y:z.3f} m, {math.degrees(heading):z.0f}°"))
    if isinstance(belief, PlaceBelief):
        place = int(np.argmax(belief.probabilities))
        facts.append(("believed", f"place {place}, {100 * belief.probabilities[place]:.0f} %"))
    elif belief is not None and np.isfinite(spread := _spread_m(belief)) and spread > 0:
        facts.append(("spread of the belief", f"{spread:.3f} m"))
    if drive.reference[n] >= 0:
        words = [f"number {drive.reference[n]}"]
        if np.isfinite(drive.similarity[n]):
            words.append(f"similarity {100 * drive.similarity[n]:.0f} %")
        elif np.isfinite(drive.visual_distance[n]):
            words.append(f"visual distance {drive.visual_distance[n]:.2f}")
        if spot is not None and np.isfinite(gap := math.hypot(*(spot - drive.truth[n])[:2])):
            words.append(f"taken {gap:.2f} m away")
        facts.append(("best match", ", ".join(words)))
    return facts
