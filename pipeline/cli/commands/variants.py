"""`omninav variants`: what `variant=` can be, and what each takes."""

from hydra import compose
from omegaconf import OmegaConf

from omninav.pipeline.cli.config_groups import group_files
from omninav.pipeline.cli.hydra_session import hydra_started
from omninav.pipeline.run.inputs import read_inputs


def command(arguments: list[str]) -> int:
    """Print a line for each variant, and one for each of its inputs."""
    with hydra_started():
        for file in group_files("variant"):
            name = file.name.removesuffix(".yaml")
            comments = (
                line
                for line in file.read_text(encoding="utf-8").split("\n")
                if line.startswith("# ") and "@package" not in line
            )
            print(f"{name:27} {next(comments, '').lstrip('# ')}")
            declared = compose("config", overrides=[f"variant={name}"]).inputs
            for setting, given in read_inputs({"inputs": OmegaConf.to_container(declared)}).items():
                print(f"{'':27}   {setting}=…  {given.meaning}{' (required)' if given.required else ''}")
    return 0
