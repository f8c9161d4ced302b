"""Which computers can send to a node: this one alone, unless the user opens the network."""

import os
from importlib.resources import files
from typing import Final

RANGE: Final = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES: Final = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
FROM_PROFILE: Final = "RMW_FASTRTPS_USE_QOS_FROM_XML"  # also how memory is used, not QoS alone
CLOSED: Final = ("", "LOCALHOST")
FAST_DDS: Final = ("", "rmw_fastrtps_cpp", "rmw_fastrtps_dynamic_cpp")


def stay_on_this_host() -> None:
    """Bind all sockets of this process, and of its children, to 127.0.0.1; before `rclpy.init`.

    ROS's own LOCALHOST only stops nodes from looking for others: their sockets accept packets from
    any computer. Another value of ``ROS_AUTOMATIC_DISCOVERY_RANGE``, such as SUBNET, opens the
    network. Profiles of the user's own are left as they are, and so is other middleware.
    """
    if os.environ.get(RANGE, "") not in CLOSED or any(map(os.environ.get, PROFILES)):
        return
    if os.environ.get("RMW_IMPLEMENTATION", "") not in FAST_DDS:
        os.environ[RANGE] = "LOCALHOST"
        return
    os.environ[PROFILES[0]] = str(files("sain_core.ros") / "loopback.xml")
    os.environ.setdefault(FROM_PROFILE, "1")
    os.environ[RANGE] = "SYSTEM_DEFAULT"  # with any other, ROS replaces the transports of a profile
