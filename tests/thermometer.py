"""A world without robots, for the tests of the framework: a thermometer in a room, and a stage that smooths it."""

import json
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from omninav.pipeline import (
    Bounds,
    Context,
    Figure,
    Metrics,
    Outputs,
    Quantity,
    Source,
    Stage,
    State,
    Table,
    Tick,
    Value,
)
from omninav.pipeline.files import digest_file, digest_text
from omninav.pipeline.report.plot_style import plot


class Temperature(Value):
    celsius: float


class RoomState(State):
    reading: int = 0


class Room(Source):
    """The temperature of a room, which rises and falls once in 40 readings; computed, or read from a file."""

    readings: Annotated[int, Bounds(ge=1)] = 40
    swing: float = 3.0
    file: str | None = None

    class Out(Outputs):
        tick: Tick
        truth: Temperature

    def step(self, ctx: Context, state: RoomState) -> Out | None:
        number = state.reading
        state.reading += 1
        if self.file is not None:
            recorded = json.loads(Path(self.file).read_text())
            return self._out(number, recorded[number]) if number < len(recorded) else None
        return self._out(number, self._celsius(number)) if number < self.readings else None

    def _celsius(self, number: int) -> float:
        return 20.0 + self.swing * math.sin(2.0 * math.pi * number / 40.0)

    def _out(self, number: int, celsius: float) -> Out:
        return self.Out(tick=Tick(number, number * 10**9), truth=Temperature(celsius))

    def inputs_digest(self) -> str | None:
        return None if self.file is None else digest_file(Path(self.file))

    def recording_key(self) -> str | None:
        return digest_text(str(self.readings), str(self.swing)) if self.file is None else None

    def recording_name(self) -> str:
        return f"room of {self.readings} readings"

    def record(self, ctx: Context, folder: Path) -> None:
        (folder / "room.json").write_text(json.dumps([self._celsius(number) for number in range(self.readings)]))
        ctx.fact("length_s", self.readings)

    def replay(self, folder: Path) -> Mapping[str, Any]:
        return {"file": str(folder / "room.json"), "readings": None, "swing": None}


class Thermometer(Stage):
    """A reading with noise."""

    noise: Annotated[float, Bounds(ge=0)] = 1.0

    class Out(Outputs):
        reading: Temperature

    def step(self, ctx: Context, truth: Temperature) -> Out:
        return self.Out(reading=Temperature(truth.celsius + self.noise * ctx.rng.standard_normal()))


class Smoothing(Stage):
    """An exponential mean of the readings."""

    gain: Annotated[float, Bounds(gt=0, le=1)] = 0.4

    class Out(Outputs):
        mean: Temperature

    def step(self, ctx: Context, reading: Temperature, before: Temperature | None = None) -> Out:
        last = reading.celsius if before is None else before.celsius
        return self.Out(mean=Temperature(last + self.gain * (reading.celsius - last)))


QUANTITIES = {
    "error_k": Quantity(title="Error", unit="K", better="lower"),
    "within_rate": Quantity(title="Within half a degree", better="higher"),
    "readings": Quantity(context=True),
}


class TemperatureErrors(Stage):
    """How far the mean is off."""

    class Out(Outputs):
        metrics: Metrics
        table: Table
        plot: Figure

    def step(self, ctx: Context, truth: Sequence[Temperature], means: Sequence[Temperature]) -> Out:
        errors = np.abs([mean.celsius - true.celsius for mean, true in zip(means, truth, strict=True)])
        values = {
            "error_k": {"mean": float(errors.mean()), "max": float(errors.max())},
            "within_rate": float((errors < 0.5).mean()),
            "readings": len(errors),
            "course": {"reading": list(range(len(errors))), "error_k": errors.tolist()},
        }
        with plot(4.0, 2.0) as drawn:
            drawn.canvas.subplots().plot(errors)
        return self.Out(
            metrics=Metrics(values, QUANTITIES, headlines=("error_k.mean", "within_rate")),
            table=Table("largest", "Largest errors", "In kelvin.", ("error (K)",), ((float(errors.max()),),)),
            plot=Figure("errors", "Errors over time", "In kelvin.", drawn.content),
        )


def config(folder: Path, **changes: Any) -> dict[str, Any]:
    """The thermometer's graph; `changes` name parameters by `node__parameter`, or settings."""
    plain: dict[str, Any] = {
        "variant": "thermometer",
        "seed": 0,
        "runs": str(folder / "runs"),
        "cache": None,
        "nodes": {
            "room": {"_target_": "thermometer.Room"},
            "thermometer": {"_target_": "thermometer.Thermometer"},
            "smoothing": {"_target_": "thermometer.Smoothing"},
            "errors": {"_target_": "thermometer.TemperatureErrors"},
        },
        "wires": {
            "thermometer": {"truth": "room.truth"},
            "smoothing": {
                "reading": "thermometer.reading",
                "before": {"from": "smoothing.mean", "delay": 1, "initial": None},
            },
            "errors": {
                "truth": {"from": "room.truth", "collect": True},
                "means": {"from": "smoothing.mean", "collect": True},
            },
        },
    }
    for name, value in changes.items():
        node, _, parameter = name.partition("__")
        if parameter:
            plain["nodes"][node][parameter] = value
        else:
            plain[name] = value
    return plain


EXPERIMENT = {
    "name": "gains",
    "title": "Which gain smooths best",
    "about": "A small gain lags behind, a large one lets noise through.",
    "variant": "thermometer",
    "sweep": {"gain": {"0.05": "smoothing.gain=0.05", "0.4": "smoothing.gain=0.4", "1.0": "smoothing.gain=1.0"}},
    "scenarios": {f"swing {swing}": f"room.swing={swing}" for swing in (1.0, 1.4, 1.8, 2.2, 2.6, 3.0)},
    "repetitions": 2,
    "measures": {
        "error": {"title": "Error (K)", "path": ["error_k.mean"], "digits": 2},
        "rise": {"title": "Largest rise (K)", "path": ["course.error_k"], "aggregate": "largest_rise", "digits": 2},
    },
    "page": {"rows": [], "columns": "gain"},
    "curves": [{"title": "Error (K)", "x_label": "reading", "path": "course.error_k", "x_path": "course.reading"}],
    "claims": {
        "smoothing": {
            "statement": "Some smoothing is better than none",
            "measure": "error",
            "of": {"gain": "0.4"},
            "below": {"gain": "1.0"},
        },
        "less": {"statement": "Less gain is always better", "measure": "error", "of": {"gain": "0.05"}, "lowest": True},
    },
    "cores": 1,
}
