"""omninav's own configurations are read faster than Hydra reads them, and to the same content."""

from pathlib import Path

from hydra._internal.core_plugins.importlib_resources_config_source import ImportlibResourcesConfigSource

from omninav.pipeline.cli.hydra_session import OwnFiles

CONF = Path(__file__).resolve().parents[2] / "conf"


def test_every_configuration_is_read_as_hydra_reads_it():
    own, hydras = OwnFiles("own", "own://omninav.conf"), ImportlibResourcesConfigSource("hydra", "pkg://omninav.conf")
    files = [str(file.relative_to(CONF)) for file in sorted(CONF.rglob("*.yaml"))]
    assert len(files) > 100
    for file in files:
        found, expected = own.load_config(file), hydras.load_config(file)  # which refuses a key that is there twice
        assert (found.config, found.header) == (expected.config, expected.header), file
