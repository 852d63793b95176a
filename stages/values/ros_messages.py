"""ROS 2 messages as they are stored in a log."""

from collections.abc import Sequence

from omninav.pipeline import Value


class RosMessages(Value):
    """The ROS 2 messages that a tick gave, N of them, in their order.

    `topics`, `types` (N,): as text (`nav_msgs/msg/Path`). `data` (N,): their CDR bytes. `stamp`: of the tick (ns).
    """

    bulky = True

    stamp: int
    topics: tuple[str, ...]
    types: tuple[str, ...]
    data: tuple[bytes, ...]

    @classmethod
    def of(cls, stamp: int, messages: Sequence[tuple[str, str, bytes]]) -> "RosMessages":
        """From the topic, type and bytes of each message."""
        topics, types, data = zip(*messages, strict=True) if messages else ((), (), ())
        return cls(stamp, tuple(topics), tuple(types), tuple(data))
