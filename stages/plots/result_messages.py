"""A tick of a run as ROS 2 messages, for those who watch it."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.values.ros_messages import RosMessages

from .show_tick import ShownTick
from .tick_messages import PathSoFar, by_tick, tick_messages


class ResultMessages(Stage):
    """Makes the messages of each tick on some topics of `result.mcap`, for who publishes them.

    | topic | message | holds |
    |---|---|---|
    | `/grid` | OccupancyGrid | the floor plan or the grid, at a log's first frame |
    | `/map` | MarkerArray | references and edges, mixtures, or places with names |
    | `/tf` | TFMessage | `map` to `odom` and `odom` to `base_link` |
    | `/odom` | Odometry | odometry alone, from the log's first frame, in the frame `odom` |
    | `/ground_truth/pose` | PoseStamped | where the log has it |
    | `/estimate/pose` | PoseWithCovarianceStamped | the estimate; 6 x 6 covariance, plane entries only |
    | `/estimate/path` | Path | the estimates so far, every 16 ticks; all of a log's at its end |
    | `/estimate/confidence` | Float64 | probability that the estimate is right, in [0, 1] |
    | `/estimate/state` | String | `searching`, `tracking`, `lost` or `blind` (see `TrackingState`), when it changes |
    | `/belief/markers` | MarkerArray | a mixture's ellipses by their axes (one sigma), or the likely places |
    | `/belief` | PoseArray | few particles, a mixture's means, or the likely places |
    | `/similarity/best` | Float64 | the largest similarity, in [0, 1] |
    | `/similarity` | MarkerArray | the most similar references, as opaque as they are similar |
    | `/panorama/compressed` | CompressedImage | what the robot saw, small |
    | `/plan` | Path | the places of the planned route |
    | `/homing` | MarkerArray | the homing vector, from the robot |
    | `/command` | TwistStamped | what was commanded |

    `/map` comes at a log's first frame, whenever it has grown by a tenth, and at the end. Stamps are the tick's: the
    images' header stamps.
    """

    topics: tuple[str, ...] = (
        "/estimate/path", "/estimate/confidence", "/estimate/state", "/map", "/grid", "/plan", "/homing",
    )  # fmt: skip
    """Topics of `result.mcap` of which messages are made."""

    class Out(Outputs):
        messages: RosMessages

    def step(self, ctx: Context, before: PathSoFar, shown: ShownTick) -> Out:
        asked = [messages for messages in tick_messages([shown], before) if messages.topic in self.topics]
        (made,) = by_tick(asked, 1)
        return self.Out(messages=RosMessages.of(shown.tick.stamp, made))
