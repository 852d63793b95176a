"""Every promise of docs/security.md has a test."""

import ast
import re
from pathlib import Path

from offenders import assert_each

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/security.md").read_text()
TRUST, LIVE = "cli/test_trust.py", "stages/live/test_live_source.py"
TESTS = {
    "Installed packages": "pipeline/graph/test_registry.py::test_an_installed_package_offers_a_stage_by_entry_point",
    "Stages that you type": f"{TRUST}::test_a_stage_of_ones_own_is_found_here_and_the_path_is_as_before",
    "Programs that you type": f"{TRUST}::test_a_program_that_a_folder_names_is_run_only_where_it_is_typed_again",
    "Launchers and sweepers": f"{TRUST}::test_launchers_and_sweepers_of_installed_packages_take_their_parameters",
    "Clusters": "pipeline/jobs/test_worker_pool.py::test_what_crosses_to_a_cluster_is_text",
    "Networks": "stages/features/test_onnx_encoder.py::test_what_does_not_fit_is_refused_in_one_line",
    "Configurations": f"{TRUST}::test_what_a_configuration_says_of_hydra_is_refused_before_anything_is_called",
    "Words of the command line": f"{TRUST}::test_hostile_words_are_refused_in_a_few_short_lines",
    "The working directory": (
        "contract/test_working_directory.py::test_a_run_reads_nothing_of_the_folder_that_it_is_started_in"
    ),
    "Run folders": f"{TRUST}::test_resume_runs_only_stages_that_are_listed_or_typed_again",
    "YAML files": "pipeline/graph/test_small_files.py::test_what_breaks_a_limit_is_one_short_line_with_its_place",
    "Camera files": "stages/recordings/test_camera_yaml.py::test_a_hostile_file_is_refused_in_one_short_line",
    "Occupancy grids": "stages/recordings/test_occupancy_grid.py::test_values_without_bounds_are_refused_by_name",
    "Tables and layouts": (
        "stages/recordings/test_image_folder.py::test_a_wrong_or_hostile_description_is_one_line_that_names_the_place"
    ),
    "Names": "hostile/test_names.py::test_an_experiments_name_is_a_name",
    "Logs": (
        "pipeline/mcap/test_reader_and_writer.py"
        "::test_a_chunk_that_unpacks_to_far_more_than_a_log_holds_is_not_unpacked"
    ),
    "Maps": "hostile/test_examples.py::test_a_map_whose_sum_is_right_over_wrong_content_is_refused_by_name",
    "Tables of runs": "hostile/test_limits.py::test_a_table_of_parquet_unpacks_in_proportion_to_its_size",
    "Images": "stages/values/test_encoded_image.py::test_an_image_that_says_it_is_too_large_is_not_decoded",
    "Special files": "pipeline/graph/test_small_files.py::test_what_is_no_file_is_named_without_waiting_for_it",
    "Folders that cannot be written": f"{TRUST}::test_a_folder_that_cannot_be_used_is_one_line",
    "What a peer can do": f"{LIVE}::test_requests_that_are_turned_off_are_not_heard",
    "What it can call": "stages/live/test_amcl_interface.py::test_amcls_topics_and_services_are_answered",
    "What a message cannot do": f"{LIVE}::test_a_damaged_message_is_counted_and_the_drive_goes_on",
    "What it can read": "stages/live/test_every_message.py::test_over_dds",
    "How far it is found": "stages/live/test_transport.py::test_discovery_reaches_as_far_as_ros_says",
    "SROS 2": "stages/live/test_every_message.py::test_a_keystore_that_is_not_there_is_one_line",
    "Zenoh": "stages/live/test_zenoh_transport.py::test_a_configuration_that_is_none_is_refused_in_one_line",
    "Foxglove": "foxglove/test_foxglove.py::test_foxgloves_client_watches_a_run_and_gets_what_was_sent_before_it_came",
    "Rerun": "stages/plots/test_rerun_view.py::test_only_this_computer_is_served",
}
"""The beginning of an item of the page -> its test, from this folder's parent."""


def test_every_item_of_the_page_has_a_test_and_every_test_its_item() -> None:
    assert re.findall(r"^\* \*\*([^*]+)\*\*", PAGE, re.MULTILINE) == list(TESTS)


def test_the_test_of_every_item_exists() -> None:
    assert_each(TESTS, its_test_exists)


def its_test_exists(item: str) -> None:
    file, _, name = TESTS[item].partition("::")
    tree = ast.parse((ROOT / "tests" / file).read_text())
    assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
