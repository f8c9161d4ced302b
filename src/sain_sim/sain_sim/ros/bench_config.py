"""What a trajectory server is started with."""

from sain_arm.laboratory.laboratory_config import LaboratoryConfig

__all__ = ["LaboratoryConfig"]
