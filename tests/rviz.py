"""What RViz keeps of marker arrays: the rules of its ``MarkerCommon``, without drawing."""

from collections import Counter

from visualization_msgs.msg import Marker, MarkerArray


class Rviz:
    """A display of one topic: markers stay until they are replaced or deleted by group and id."""

    def __init__(self) -> None:
        self.visible: dict[tuple[str, int], Marker] = {}
        self.problems: list[str] = []

    def receive(self, array: MarkerArray) -> None:
        ids = Counter((marker.ns, marker.id) for marker in array.markers)
        self.problems += [f"{one} comes {count} times" for one, count in ids.items() if count > 1]
        for marker in array.markers:
            if marker.action == Marker.DELETEALL:
                gone = [key for key in self.visible if marker.ns in ("", key[0])]
                for key in gone:
                    del self.visible[key]
            elif marker.action == Marker.DELETE:
                self.visible.pop((marker.ns, marker.id), None)
            else:
                self._draw(marker)

    def _draw(self, marker: Marker) -> None:
        key = marker.ns, marker.id
        flat = marker.type in (Marker.LINE_STRIP, Marker.LINE_LIST, Marker.TEXT_VIEW_FACING)
        scale = (marker.scale.x, marker.scale.y, marker.scale.z)
        if not (any(scale) if flat else all(scale)):
            self.problems.append(f"{key} has the scale {scale}")
        if marker.header.frame_id != "world":
            self.problems.append(f"{key} is in {marker.header.frame_id!r}")
        self.visible[key] = marker

    def count(self) -> dict[str, int]:
        """How many markers of each group are visible."""
        return dict(Counter(group for group, _ in self.visible))


def shown(arrays: list[MarkerArray]) -> Rviz:
    """Return RViz after these arrays."""
    rviz = Rviz()
    for array in arrays:
        rviz.receive(array)
    assert not rviz.problems, rviz.problems
    return rviz
