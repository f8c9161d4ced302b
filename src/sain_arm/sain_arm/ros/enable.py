"""``ros2 run sain_arm enable``: lets the arm move for as long as this runs.

At its end it also cancels all goals of the controller itself: `arm_node`, which does so too, may be
dead.
"""

from dataclasses import dataclass

from rich.console import Console

from sain_core.config import Config, option


@dataclass(frozen=True)
class EnableOptions(Config):
    """Let the arm move until Ctrl-C."""

    robot: str = option("", "its file or name: at the end its controller's goals are cancelled")
    seconds: float = option(0.0, "end after this time; 0: on Ctrl-C", unit="s", minimum=0.0)


def run(options: EnableOptions, console: Console) -> int:
    """Publish the heartbeat until the end.

    Raises:
        ConfigError: no such robot.
    """
    from sain_arm.robot.robot import read_robot
    from sain_arm.ros.enabling import publish_heartbeat

    controller = read_robot(options.robot).controller if options.robot else ""
    publish_heartbeat(
        options.seconds,
        controller,
        lambda topic: console.print(f"the arm may move: {topic}. Ctrl-C stops it."),
    )
    return 0
