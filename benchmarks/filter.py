"""One step of the particle filter, beside the libraries `particles` and `filterpy`."""

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.fusion.importance_resampling import ImportanceResampling
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.sensor.similarity_proposals import SimilarityProposals
from omninav.stages.values.belief import Particles
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

from .table import Row, medians, milliseconds

NUMBER = 5000
STEPS = 20


def rows() -> list[Row]:
    """Motion, weights and resampling of 5000 particles, without the image work."""
    return [*_step(), *_resampling(), _estimate()]


def _particles() -> Particles:
    rng = np.random.default_rng(0)
    poses = np.array([50.0, 30.0, 0.0]) + rng.normal(0, [0.5, 0.5, 0.2], (NUMBER, 3))
    return Particles(poses, np.full(NUMBER, 1 / NUMBER))


def _step() -> list[Row]:
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(0, 100, 3500), rng.uniform(0, 60, 3500), rng.uniform(-3, 3, 3500)])
    whole = ReferenceGraph(poses, np.zeros((3500, 1, 1), np.float32), "histograms", np.zeros((0, 2), np.int64), "truth")
    candidates = np.flatnonzero(np.hypot(poses[:, 0] - 50, poses[:, 1] - 30) < 4)
    field = Similarities(rng.uniform(0.4, 0.9, (len(candidates), 36)).astype(np.float32), candidates)
    motion, sensor, fusion = RotationTranslationRotation(), NearReferences(), ImportanceResampling()
    proposals = SimilarityProposals()
    ctx = Context("filter", rng)
    ctx.tick = Tick(1, 1)
    for stage in (motion, sensor, proposals, fusion):
        stage.setup(ctx)
    moved, length_scale, start = Motion(0.2, 0.0, 0.05), LengthScale(0.6), _particles()

    def ours() -> None:
        predicted = motion.step(ctx, start, moved, MeasuredNoise()).belief
        weighted = sensor.step(ctx, field, predicted, whole, moved, length_scale)
        proposed = proposals.step(ctx, weighted.field, whole, length_scale).proposals
        fusion.step(ctx, predicted, weighted.likelihood, proposed)

    peer = _library()
    taken = medians({"ours": ours} | ({} if peer is None else {"particles": peer}), rounds=40)
    found = [milliseconds(f"filter step, {NUMBER} particles: motion, weights, resampling", taken["ours"], limit=1.0)]
    if peer is not None:
        what, theirs = "particles.SMC, 10 range landmarks", taken["particles"] / STEPS
        found.append(milliseconds("the same, beside", taken["ours"], what, theirs, limit=1.0, of_peer=True))
    return found


def _library():
    """A bootstrap filter of the library `particles` on a robot that sees 10 landmarks; None where not installed."""
    try:
        import particles
        from particles import distributions as dists
        from particles import state_space_models as ssm
    except ImportError:
        return None
    landmarks = np.random.default_rng(2).uniform(0, 10, (10, 2))

    class Robot(ssm.StateSpaceModel):
        def PX0(self):  # noqa: N802
            return dists.IndepProd(dists.Normal(5, 1), dists.Normal(5, 1), dists.Normal(0, 0.2))

        def PX(self, t, xp):  # noqa: N802
            x = xp[:, 0] + 0.1 * np.cos(xp[:, 2])
            y = xp[:, 1] + 0.1 * np.sin(xp[:, 2])
            return dists.IndepProd(dists.Normal(x, 0.02), dists.Normal(y, 0.02), dists.Normal(xp[:, 2], 0.02))

        def PY(self, t, xp, x):  # noqa: N802
            ranges = [np.hypot(x[:, 0] - a, x[:, 1] - b) for a, b in landmarks]
            return dists.IndepProd(*[dists.Normal(r, 0.2) for r in ranges])

    model = Robot()
    data = [np.hypot(*(landmarks - 5).T)[None, :] for _ in range(STEPS)]
    bootstrap = ssm.Bootstrap(ssm=model, data=data)
    return lambda: particles.SMC(fk=bootstrap, N=NUMBER, resampling="systematic", ESSrmin=0.5).run()


def _resampling() -> list[Row]:
    rng = np.random.default_rng(3)
    weights = rng.random(NUMBER) ** 4
    weights /= weights.sum()
    functions = {"ours": lambda: systematic(weights, NUMBER, 0.4)}
    try:
        from particles import resampling

        functions["particles"] = lambda: resampling.systematic(weights)
    except ImportError:
        pass
    try:
        from filterpy.monte_carlo import systematic_resample

        functions["filterpy"] = lambda: systematic_resample(weights)
    except ImportError:
        pass
    taken = medians(functions, rounds=60)
    what = f"systematic resampling of {NUMBER}"
    return [
        milliseconds(what, taken["ours"], name, taken[name], limit=1.0, of_peer=True)
        for name in ("particles", "filterpy")
        if name in taken
    ]


def _estimate() -> Row:
    belief = _particles()
    taken = medians({"ours": belief.estimate}, rounds=40)
    return milliseconds(f"estimate of {NUMBER} particles (heaviest mode, covariance)", taken["ours"])
