"""What a simulator keeps of its episode, so that another process goes on where it crashed."""

from dataclasses import dataclass
from typing import Final

from sain_core.errors import DatasetError
from sain_core.ros.state_file import StateFile, message_of, text_of
from sain_interfaces.msg import Push
from sain_interfaces.srv import ResetScene

LOST_TIME: Final = 60.0  # [s], simulated: the clock had gone on, and never goes back


@dataclass(frozen=True, eq=False)
class Moment:
    """A settled scene, and all that it takes to be there again.

    Attributes:
        reset: what leads to the scene: seed, world, bodies with masses and radii, friction.
        episode_id: as in `Session`.
        scene_id: as in `Session`.
        time: simulated [s].
        push: the one that was under way; None: there was none.
        listeners: nodes that heard the simulator.
    """

    reset: ResetScene.Request
    episode_id: int
    scene_id: int
    time: float
    push: Push | None = None
    listeners: tuple[str, ...] = ()

    def write(self, file: StateFile) -> None:
        """Replace what a file holds."""
        push = "" if self.push is None else text_of(self.push)
        file.write(
            reset=text_of(self.reset),
            episode_id=self.episode_id,
            scene_id=self.scene_id,
            time=self.time,
            push=push,
            listeners=self.listeners,
        )

    @classmethod
    def read(cls, file: StateFile) -> "Moment | None":
        """Return what a file holds; None: there is none.

        Raises:
            DatasetError: it is damaged.
        """
        state = file.read()
        if not state:
            return None
        try:
            ids = int(state["episode_id"]), int(state["scene_id"])
            push = message_of(Push, state["push"]) if state["push"] else None
            reset = message_of(ResetScene.Request, state["reset"])
            heard_by = tuple(str(name) for name in state["listeners"])
            return cls(reset, *ids, float(state["time"]), push, heard_by)
        except (KeyError, TypeError, ValueError) as error:
            raise DatasetError(f"the state of the simulator is damaged: {error!r}") from error
