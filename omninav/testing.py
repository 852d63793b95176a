"""Checks for a third party's stages: `from omninav.testing import check_stage`."""

from omninav.pipeline.api.stage_check import check_stage

__all__ = ["check_stage"]
