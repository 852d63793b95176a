"""Results of a graph that has run."""

from types import SimpleNamespace

from omninav.pipeline import Context, Metrics
from omninav.pipeline.run.run_results import results_of


def run_of(**stated: dict[str, object]) -> SimpleNamespace:
    """A graph that has run, each node with these figures."""
    return SimpleNamespace(
        graph=SimpleNamespace(nodes={name: SimpleNamespace(name=name, origins=[f"{name}.metrics"]) for name in stated}),
        calls={name: SimpleNamespace(ctx=Context(name)) for name in stated},
        last=lambda port: Metrics(stated[port.split(".")[0]]),
    )


def test_who_replaces_a_figure_of_another_stage_is_warned_of_and_its_own_is_kept():
    engine = run_of(
        errors={"frames": 7, "error_m": {"mean": 1.0}, "lost": 0},
        mine={"frames": 7, "error_m": {"mean": 2.0}, "cost": 3},
    )
    assert results_of(engine)[0].values == {"frames": 7, "error_m": {"mean": 2.0}, "lost": 0, "cost": 3}
    assert engine.calls["mine"].ctx.warnings == [
        "mine: error_m.mean in metrics.json is its own, not that of errors; give it another name"
    ]
    assert not engine.calls["errors"].ctx.warnings
