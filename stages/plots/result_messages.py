"""A tick of a run as ROS 2 messages, for whoever watches it."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.ros_messages import RosMessages

from .show_tick import ShownTick
from .tick_messages import PathSoFar, by_tick, tick_messages


class ResultMessages(Stage):
    """Makes the messages of each tick on some topics of `result.mcap` (see `tick_messages`), for who publishes them."""

    topics: tuple[str, ...] = ("/estimate/path", "/estimate/confidence", "/map", "/grid", "/plan", "/homing")
    """Topics of `result.mcap` of which messages are made."""

    class Out(Outputs):
        """`messages`: of this tick."""

        messages: RosMessages

    def step(self, ctx: Context, before: PathSoFar, shown: ShownTick) -> Out:
        """One tick."""
        asked = [messages for messages in tick_messages([shown], before) if messages.topic in self.topics]
        (made,) = by_tick(asked, 1)
        return self.Out(messages=RosMessages.of(shown.tick.stamp, made))
