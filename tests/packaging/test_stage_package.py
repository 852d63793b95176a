"""The template of a package with a stage works as it stands, and its check finds what a stage does not keep."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Annotated

import numpy as np
import pytest

from omninav import Bounds, Context, Outputs, Stage, State
from omninav.testing import check_stage
from toys import Number

PACKAGE = Path(__file__).resolve().parents[2] / "examples" / "stage_package"


def test_the_templates_own_tests_pass():
    path = os.pathsep.join([str(PACKAGE), *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", PACKAGE, PACKAGE / "tests"]
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    ended = subprocess.run(command, cwd=PACKAGE, env=environment, capture_output=True, text=True, timeout=120)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    assert ended.stdout.startswith(".. ")


def test_its_stage_fits_into_a_variant_and_a_variant_with_it_is_listed(
    omninav, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    named = f"features.brightness={PACKAGE / 'omninav_brightness.py'}:BrightnessHistogram"
    monkeypatch.setenv("OMNINAV_STAGES", named)
    assert "nothing wrong" in omninav("check", "features=brightness", check=True).stdout
    (tmp_path / "variant").mkdir()
    own = "# @package _global_\n# by brightness\ndefaults: [omniview_mcl, override /features: brightness, _self_]\n"
    (tmp_path / "variant" / "bright.yaml").write_text(own)
    listed = omninav("variants", f"--config-dir={tmp_path}", check=True).stdout
    assert any(line.startswith("bright ") and "by brightness" in line for line in listed.split("\n"))


class Drifts(Stage):
    """Adds what it has seen before, which it keeps where no checkpoint finds it."""

    class Out(Outputs):
        number: Number

    def setup(self, ctx: Context) -> None:
        self._sum = 0.0

    def step(self, ctx: Context, number: Number) -> Out:
        self._sum += number.value
        return self.Out(number=Number(self._sum))


class Keeps(Stage):
    """Adds what it has seen before, and noise, and keeps it in its State."""

    class Sum(State):
        value: float = 0.0

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number, sum: Sum) -> Out:
        sum.value += number.value + float(ctx.rng.normal())
        return self.Out(number=Number(sum.value))


class Gambles(Stage):
    """Draws its numbers from a generator that nobody has seeded."""

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(number=Number(float(np.random.default_rng().normal())))


class Mute(Stage):
    gain: Annotated[float, Bounds(gt=1)] = 2.0

    class Out(Outputs):
        number: Number

    def step(self, ctx: Context, number: Number) -> Out:
        return self.Out(number=None)


FRAMES = [{"number": Number(float(n))} for n in range(6)]


def test_a_stage_that_keeps_everything_in_its_state_passes():
    assert len(check_stage(Keeps, FRAMES)) == 6


@pytest.mark.parametrize(
    ("stage", "what"), [(Drifts, "after its State was saved"), (Gambles, "with the same seed it gives other outputs")]
)
def test_a_stage_that_cannot_go_on_or_be_repeated_is_found(stage, what):
    with pytest.raises(AssertionError, match=what):
        check_stage(stage, FRAMES)


def test_everything_that_is_wrong_with_a_class_is_said_at_once():
    with pytest.raises(AssertionError) as found:
        check_stage(Mute)
    assert "docstring begins with ''" in str(found.value)
    assert "'gain' is not explained" in str(found.value)
