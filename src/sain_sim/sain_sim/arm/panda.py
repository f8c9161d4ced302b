"""The Panda with its stick: its settings and its description on disk."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sain_core.config import Config, option
from sain_core.scratch import scratch_folder
from sain_sim.arm.client import Client
from sain_sim.arm.controlled import JOINT_COUNT
from sain_sim.arm.urdf import panda_with_stick

JOINT_NAMES: Final = tuple(f"panda_joint{index}" for index in range(1, JOINT_COUNT + 1))


@dataclass(frozen=True)
class ArmConfig(Config):
    """How the arm is built and controlled.

    `gain` and `inertia_scale` are for Bullet alone. In MuJoCo, `torque_scale` is also the stiffness
    of the servos, as a multiple of that in MuJoCo Menagerie.
    """

    tool_length: float = option(
        0.22, "distance from the flange to the tip", unit="m", minimum=0.15, maximum=0.4
    )
    gain: float = option(
        0.6, "share of a position error that a step corrects", minimum=0.05, maximum=1.0
    )
    torque_scale: float = option(
        20.0, "joint torque limits, as a multiple of Franka's", minimum=0.1, maximum=100.0
    )
    # Rotors turn a hundred times faster than the joints behind their gears, so an arm resists a
    # knock with far more than its links. Bullet has no rotors, and its solver does not converge
    # for light links that push heavy disks: the tool deviated, depending on the arm's pose.
    inertia_scale: float = option(
        20.0, "inertia of the links, as a multiple of Franka's", minimum=0.1, maximum=1000.0
    )
    tool_stiffness: float = option(
        0.0,
        "stiffness of the spring that holds the stick; 0: rigid",
        unit="N/m",
        minimum=0.0,
        maximum=2e4,
    )
    tool_torque_scale: float = option(
        0.0,
        "joint torque limits for a stick on a spring, as a multiple of Franka's; 0: none",
        minimum=0.0,
        maximum=100.0,
    )


class PandaModel:
    """The robot description on disk, for as long as this object lives, and how to load it."""

    def __init__(self, tool_radius: float, config: ArmConfig, visuals: bool = False) -> None:
        """Write the URDF of a Panda with this stick [m]; visuals are meshes for pictures."""
        self.config = config
        self.tool_radius = tool_radius
        self._folder = scratch_folder("panda")
        self._path = Path(self._folder.name) / "panda.urdf"
        self._path.write_text(
            panda_with_stick(
                tool_radius,
                config.tool_length,
                config.inertia_scale,
                visuals,
                sprung=config.tool_stiffness > 0.0,
            )
        )

    def load(self, client: Client, base_height: float) -> int:
        """Load the arm with its base at z = base_height [m] and return its body."""
        flags = client.URDF_USE_IMPLICIT_CYLINDER
        body: int = client.loadURDF(
            str(self._path), [0.0, 0.0, base_height], useFixedBase=True, flags=flags
        )
        return body
