"""Checks the camera of a mapping run by its own images."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline import Context, MetricSpec
from omninav.stages.camera.model import Camera
from omninav.stages.camera.rays import turned
from omninav.stages.camera.self_calibration import (
    AXIS,
    SAME_RAY,
    TILT,
    adjustable,
    corrected,
    leaning,
    observed,
    with_elevations_found,
    with_tilt,
)
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.landmarks.adjustment import Lens
from omninav.stages.geometry.landmarks.leaning_images import Levelling
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches
from omninav.stages.recordings.camera_yaml import write_camera
from omninav.stages.values.local_features import LocalFeatures

CAMERA_SPECS = {
    "camera.axis_beside_px": MetricSpec(title="Camera's axis beside where it is described", unit="px", context=True),
    "camera.tilt_deg": MetricSpec(title="Camera's tilt", unit="deg", context=True),
    "camera.yaw_beside_deg": MetricSpec(title="Camera turned against its description", unit="deg", context=True),
    "camera.delay_beside_s": MetricSpec(title="Images later than their description says", unit="s", context=True),
    "camera.position_beside_m": MetricSpec(
        title="Camera's position on the robot beside its description", unit="m", context=True
    ),
}
MAX_AXIS = math.radians(0.2)
"""Angle by which an axis that is off moves a bearing, the median, above which it is reported (rad)."""
MAX_YAW = math.radians(1.0)
"""Angle by which the camera is turned, above which it is reported (rad): of true headings it would be as large."""
MAX_TILT = math.radians(1.0)
"""Angle by which the camera leans, above which it is reported (rad)."""
MIN_VIEWS = 40
"""Fewest references by which a camera is judged: of 20 an exact one was found 1 px beside its axis, of 16 leaning by 1
degree, of 4 by 8 (7 tours of simulated offices, an institute, a store and a house)."""


class CameraCheck(NamedTuple):
    """A camera whose `fields`, then roll and pitch, are adjusted with a map.

    `camera`: None where nothing of it can be, as by few references, of bearings that are not those of its pixels
    (images that were unwarped before, logs of several cameras) and of one that does not see the full circle.
    `levelling`: of each bearing as it is described, where images tilt differently; else None.
    """

    camera: Camera | None
    fields: dict[str, float]
    pixels: Array
    bearings: Array
    levelling: Levelling | None = None

    @classmethod
    def of(
        cls, camera: Camera | None, found: Sequence[LocalFeatures | None], bearings: Array, poses_given: bool
    ) -> "CameraCheck":
        """The check of a map's features with these bearings (F, 3) of all references in order."""
        pixels = np.concatenate([np.empty((0, 2)), *(each.points for each in found if each is not None)])
        few = len(found) < MIN_VIEWS or not len(pixels)
        if few or camera is None or not camera.elevations_known or camera.elevations is None:
            return cls(None, {}, pixels, bearings)
        names = observed(camera, poses_given)
        rays = adjustable(camera, pixels, names).bearings(np.zeros(len(names)))
        same = np.abs(rays - bearings).max() < SAME_RAY
        return cls(camera if same else None, names if same else {}, pixels, bearings)

    def seen(self, features: Ints) -> Lens:
        """The lens of the adjustment."""
        if self.camera is None:
            bearings = self.bearings[features]
            lens = Lens(lambda _: bearings, np.empty(0))
        else:
            lens = with_tilt(adjustable(self.camera, self.pixels[features], self.fields))
        if self.levelling is None:
            return lens
        by = self.levelling.of(features)

        def level(corrections: Array) -> Array:
            yaw = 0.0 if self.camera is None else self._named(corrections).get("yaw", 0.0)
            return turned(by.level(turned(lens.bearings(corrections), -yaw)), yaw)

        return Lens(level, lens.sigmas)

    def levelled(self, views: LocalViews, corrections: Array) -> LocalViews:
        """The views of the camera with its axis where it is, and level; its yaw is as it is described."""
        if self.camera is None or not len(corrections):
            return views
        by, yaw, moved = self._named(corrections), self.yaw_beside(corrections), self._moved(corrections)
        bearings = self.bearings if moved is self.camera else self._seen_by(moved)
        bearings = turned(leaning(turned(bearings, yaw), by["roll"], by["pitch"]), -yaw)
        if self.levelling is not None:
            bearings = self.levelling.level(bearings)
        return views.looking_along(bearings)

    def yaw_beside(self, corrections: Array) -> float:
        """Angle (rad) by which the camera is turned against its description, 0 where it is small."""
        yaw = self._named(corrections).get("yaw", 0.0) if self.camera is not None and len(corrections) else 0.0
        return yaw if abs(yaw) > MAX_YAW else 0.0

    def metrics(self, corrections: Array, mount: Array, late_s: float) -> dict[str, Any]:
        """Deviations of the camera from its description; `mount` (3,): of where it sits on the robot (m, m, rad).

        `late_s`: by how much more its images are late (s).
        """
        values = {"position_beside_m": math.hypot(mount[0], mount[1])} if mount[:2].any() else {}
        if late_s:
            values["delay_beside_s"] = late_s
        if mount[2]:
            values["yaw_beside_deg"] = abs(math.degrees(mount[2]))
        if self.camera is None or not len(corrections):
            return {"camera": values} if values else {}
        by = self._named(corrections)
        values["tilt_deg"] = math.degrees(math.hypot(by["roll"], by["pitch"]))
        if AXIS.keys() <= by.keys():
            values["axis_beside_px"] = math.hypot(by["centre_x"], by["centre_y"])
        if "yaw" in by:
            values["yaw_beside_deg"] = abs(math.degrees(by["yaw"]))
        return {"camera": values}

    def told(self, ctx: Context, camera: Camera | None, corrections: Array, mount: Array, late_s: float) -> str:
        """Say what is wrong with the description, and give the `camera.yaml` that has it right; empty where it is.

        `mount` (3,), `late_s`: how the camera sits on the robot, and how late its images are, otherwise than described
        (m, m, rad; s). A camera.yaml cannot state that a camera leans.
        """
        if camera is None:
            return ""
        right, parts = camera, []
        if self.camera is not None and len(corrections):
            by = self._named(corrections)
            _say_tilt(ctx, math.degrees(by["roll"]), math.degrees(by["pitch"]))
            right = self._moved(corrections)
            if right is not self.camera:
                beside = math.hypot(by["centre_x"], by["centre_y"])
                at = ", ".join(f"{getattr(right, name):.1f}" for name in AXIS)
                parts.append(f"its axis is off by {beside:.1f} px, at {at}")
        if mount[2]:
            right = replace(right, yaw=right.yaw + float(mount[2]))
            parts.append(f"it is turned by {math.degrees(mount[2]):.1f} degrees more, yaw {right.yaw:.3f}")
        if mount[:2].any():
            x, y = (round(float(value), 3) + 0.0 for value in camera.mount[:2] + mount[:2])
            right = replace(right, position_x=x, position_y=y)
            parts.append(f"it sits at x = {x:z.2f}, y = {y:z.2f} m on the robot (forward, left)")
        if late_s:
            right = replace(right, delay=round((right.delay or 0.0) + late_s, 3) + 0.0)
            parts.append(f"its images are stamped {abs(late_s):.2f} s too {'late' if late_s > 0.0 else 'early'}")
        if not parts:
            return ""
        return _told(ctx, "; ".join(parts), "Landmarks allow for it, colours are compared less exactly", right)

    def elevations_told(
        self, ctx: Context, camera: Camera | None, views: LocalViews, matches: PairMatches, poses: Array
    ) -> str:
        """Report the horizon of a strip that does not state its elevations, as `told`."""
        if camera is None or camera.elevations_known or not len(self.pixels):
            return ""
        if np.abs(camera.unproject(self.pixels)[0] - self.bearings).max() > SAME_RAY:
            return ""
        ctx.status("finding the horizon of the strip")
        right = with_elevations_found(camera, self.pixels, views, matches, poses)
        if right is None:
            return ""
        top, bottom = (math.degrees(each) for each in right.elevations)
        found = f"its rows go from {top:.1f} to {bottom:.1f} degrees above the horizon, not stated in camera.yaml"
        return _told(ctx, found, "The map is less exact by it", right)

    def _named(self, corrections: Array) -> dict[str, float]:
        return dict(zip((*self.fields, *TILT), corrections.tolist(), strict=True))

    def _moved(self, corrections: Array) -> Camera:
        """The camera with its axis where the images show it, or as it is described where that moves bearings little."""
        assert self.camera is not None
        by = self._named(corrections)
        if not AXIS.keys() <= by.keys():
            return self.camera
        moved = corrected(self.camera, AXIS, np.array([by[name] for name in AXIS]))
        cos = np.einsum("ij,ij->i", self._seen_by(moved), self.bearings)
        return moved if np.median(np.arccos(np.clip(cos, -1.0, 1.0))) > MAX_AXIS else self.camera

    def _seen_by(self, camera: Camera) -> Array:
        """Bearings (F, 3) of the features by another camera, as they were where it shows nothing."""
        rays, looks = camera.unproject(self.pixels)
        return np.where(looks[:, None], rays, self.bearings)


def _say_tilt(ctx: Context, roll: float, pitch: float) -> None:
    if math.radians(math.hypot(roll, pitch)) > MAX_TILT:
        along = f"{abs(pitch):.1f} degrees {'forward' if pitch > 0.0 else 'backward'}"
        found = f"{along} and {abs(roll):.1f} to the {'right' if roll > 0.0 else 'left'}"
        ctx.fact("camera_leans", found)
        ctx.warn(
            f"the tour's images show that the camera leans by {found}. Landmarks allow for it, colours are compared "
            "less exactly: level the camera"
        )


def _told(ctx: Context, found: str, harm: str, right: Camera) -> str:
    ctx.fact("camera_found", found)
    ctx.warn(
        f"the tour's images show that the camera is not as it is described: {found}. {harm}; "
        "the run's folder has the right description: type camera=FOLDER/camera.yaml"
    )
    return write_camera(right)
