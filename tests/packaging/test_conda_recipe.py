"""The conda recipe says what pyproject.toml says."""

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).parents[2]
OF_CONDA = {"opencv-python-headless": "py-opencv", "matplotlib": "matplotlib-base"}
"""Packages that have another name on conda-forge."""


def test_recipe_has_the_version_the_packages_and_the_command_of_the_project() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    recipe = yaml.safe_load((ROOT / "packaging" / "conda" / "recipe.yaml").read_text())
    assert recipe["package"]["version"] == project["version"]
    assert recipe["about"]["license"] == project["license"]
    names = dict(_name_and_versions(each) for each in project["dependencies"])
    expected = {OF_CONDA.get(name, name): versions for name, versions in names.items()}
    found = dict(_name_and_versions(each) for each in recipe["requirements"]["run"])
    assert found == {"python": project["requires-python"], **expected}
    (entry,) = recipe["build"]["python"]["entry_points"]
    assert entry == f"omninav = {project['scripts']['omninav']}"


def test_docker_image_installs_an_extra_that_there_is() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    (line,) = [line for line in (ROOT / "packaging" / "Dockerfile").read_text().splitlines() if ".whl)[" in line]
    extra = line.partition(".whl)[")[2].partition("]")[0]
    assert extra in project["optional-dependencies"]


def _name_and_versions(requirement: str) -> tuple[str, str]:
    begin = min(requirement.find(sign) for sign in "><=" if sign in requirement)
    return requirement[:begin].strip(), requirement[begin:].strip()
