"""What every built-in stage promises."""

import dataclasses
import inspect

import pytest
import yaml

from omninav.pipeline import Tick, Value
from omninav.pipeline.engine.codec import decode, encode
from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.registry import Entry, built_in, resolve
from omninav.pipeline.graph.signature import signature
from omninav.pipeline.graph.value import VALUE_TYPES

ENTRIES = list(built_in())
by_name = pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.target.rpartition(".")[2])


NOT_YET_DOCUMENTED = [
    "control.follow_homing",
    "control.wall_avoider",
    "features.averaged",
    "features.colour_histogram",
    "features.dct",
    "features.fourier",
    "features.global_colours",
    "features.haar_integral",
    "features.hsv_histogram",
    "features.mean_rgb",
    "features.pca",
    "features.rotation_reduced_sift",
    "features.vertical_segments",
    "fusion.agreement",
    "fusion.covariance_intersection",
    "fusion.growing_prior",
    "fusion.importance_resampling",
    "fusion.particle_clustering",
    "fusion.particle_prior",
    "fusion.place_prior",
    "fusion.uniform_recovery",
    "homing.remember_view",
    "homing.two_view_pose",
    "homing.visual_homing",
    "homing.waypoint_images",
    "mapping.adaptive_views",
    "mapping.appearance_length_scale",
    "mapping.calibrated_threshold",
    "mapping.delayed_by_distance",
    "mapping.fixed_threshold",
    "mapping.fused_mixtures",
    "mapping.image_database",
    "mapping.principal_components",
    "mapping.reference_graph",
    "mapping.supervised_views",
    "mapping.thumbnails",
    "mapping.topological",
    "mapping.unimodal_queue",
    "match.correspondences",
    "match.histogram_intersection",
    "match.l2",
    "match.neighbours",
    "match.retrieval",
    "match.selective",
    "match.visual_distance",
    "metrics.error_curves",
    "metrics.first_matches",
    "metrics.homing_errors",
    "metrics.homing_field",
    "metrics.loop_closures",
    "metrics.map_history",
    "metrics.navigation",
    "metrics.place_accuracy",
    "metrics.relative_errors",
    "metrics.success_rate",
    "metrics.trajectory_errors",
    "metrics.two_view_errors",
    "metrics.view_map_size",
    "metrics.view_spacing",
    "metrics.wrong_places",
    "motion.gaussian",
    "motion.place_transitions",
    "motion.rotation_translation_rotation",
    "perturbation.colour_noise",
    "perturbation.lost_features",
    "perturbation.odometry_noise",
    "planning.shortest_path",
    "plots.belief_snapshots",
    "plots.drive_video",
    "plots.feature_matrix",
    "plots.homing_snapshot",
    "plots.homing_snapshots",
    "plots.image_file",
    "plots.map_ellipses",
    "plots.panorama_strip",
    "plots.reference_life",
    "plots.result_log",
    "plots.retrieval_strip",
    "plots.similarity_heat_map",
    "plots.thin_belief",
    "plots.visibility_areas",
    "sensor.expected_observation",
    "sensor.line_of_sight",
    "sensor.near_references",
    "sensor.place_likelihood",
    "sensor.pose_fixes",
    "sensor.superposition",
    "sensor.visibility",
    "simulator.feature_depths",
    "simulator.floor_plan",
    "simulator.record_log",
    "simulator.world_rooms",
]
"""Modules whose parameters are still to be explained below their fields. It only shrinks."""


def test_there_are_stages():
    assert len(ENTRIES) > 20
    assert len({entry.target for entry in ENTRIES}) == len(ENTRIES)


@by_name
def test_it_says_in_its_first_line_what_it_is(entry: Entry):
    assert 20 < len(entry.summary) <= 120
    assert entry.summary.endswith(".")


@by_name
def test_its_ports_carry_values(entry: Entry):
    read = signature(resolve(entry.target))
    for port in [*read.inputs.values(), *read.outputs.values()]:
        kinds = [port.type] if inspect.isclass(port.type) else list(getattr(port.type, "__args__", [port.type]))
        kinds = [k for k in kinds if k is not Ellipsis]
        assert all(inspect.isclass(kind) and issubclass(kind, Value) for kind in kinds), (port.name, port.type)


@by_name
def test_its_defaults_pass_its_own_checks(entry: Entry):
    for parameter in signature(resolve(entry.target)).parameters.values():
        if parameter.default is not dataclasses.MISSING:
            _, problems = convert(parameter.default, parameter.type, parameter.name)
            assert not problems, [str(problem) for problem in problems]


@by_name
def test_each_of_its_parameters_says_what_it_means(entry: Entry):
    if entry.target.removeprefix("omninav.stages.").rpartition(".")[0] not in NOT_YET_DOCUMENTED:
        silent = [p.name for p in signature(resolve(entry.target)).parameters.values() if not p.meaning]
        assert not silent, f"write a docstring below each of these fields: {', '.join(silent)}"


@by_name
def test_its_state_can_be_saved_from_the_first_tick_on(entry: Entry):
    state = signature(resolve(entry.target)).state
    if state is not None:
        fresh = state[1]()
        fields = {field.name: getattr(fresh, field.name) for field in dataclasses.fields(fresh)}  # type: ignore[arg-type]
        assert decode(encode(fields)).keys() == fields.keys()


def test_every_value_says_what_it_is():
    ours = {name: cls for name, cls in VALUE_TYPES.items() if name.startswith("omninav.")}
    assert Tick in ours.values()
    for name, cls in ours.items():
        text = vars(cls).get("__doc__") or ""
        assert text, name
        assert not text.startswith(f"{cls.__name__}("), f"{name} has no docstring of its own"


def test_the_names_of_stages_in_yaml_are_read_as_text():
    for entry in ENTRIES:
        assert yaml.safe_load(entry.target) == entry.target
