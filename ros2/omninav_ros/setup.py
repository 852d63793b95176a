"""The package as colcon builds it; omninav itself is installed with pip, for the same Python."""

from xml.etree import ElementTree

from setuptools import setup

manifest = ElementTree.parse("package.xml")
name = manifest.findtext("name")

setup(
    name=name,
    version=manifest.findtext("version"),
    description=manifest.findtext("description"),
    license=manifest.findtext("license"),
    packages=[name],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml"]),
        (f"share/{name}/launch", ["launch/omninav.launch.py"]),
        (f"share/{name}/behavior_trees", ["behavior_trees/stop_and_search.xml"]),
    ],
    entry_points={"console_scripts": [f"omninav_node = {name}.node:main"]},
)
