"""A run, watched while it goes on: a WebSocket server that Foxglove connects to."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any

from omninav.pipeline import BadInput, Bounds, Context, Stage
from omninav.pipeline.mcap.message_types import standard_types

from .show_tick import ShownTick
from .tick_messages import PathSoFar, TopicMessages, tick_messages

if TYPE_CHECKING:
    import foxglove

PORT = 8765
"""Foxglove's own default."""


class FoxgloveServer(Stage):
    """Sends the messages of each tick to Foxglove: open connection, ws://localhost:8765.

    The topics are those of `result.mcap` (see `ResultMessages`), and `foxglove_layout.json` of any run shows them. Who
    connects late gets the last message of each topic; of topics that nobody watches no message is made. Nothing that a
    run writes depends on it. A later run of the same process goes on with the same server. Raises `BadInput` where
    foxglove-sdk is missing or the port is taken.
    """

    port: bool | Annotated[int, Bounds(ge=1, le=65535)] = False
    """Port to listen on; true: 8765; false: nothing is served."""
    host: str = "127.0.0.1"
    """Address to listen on: this machine alone; 0.0.0.0: every machine that reaches this one may watch."""

    def setup(self, ctx: Context) -> None:
        """Start the server, or clear what it showed of an earlier run."""
        if self.port is not False:
            self._server = _server(self.host, PORT if self.port is True else int(self.port))
            self._server.clear()

    def step(self, ctx: Context, before: PathSoFar, shown: ShownTick) -> None:
        """One tick."""
        if self.port is not False:
            self._server.send(shown.tick.stamp, tick_messages([shown], before))


@dataclass
class _Server:
    """A running server, its channels, and the stamp of the last message on each with what makes it."""

    context: Any
    channels: "dict[str, foxglove.Channel]" = field(default_factory=dict)
    last: dict[int, tuple["foxglove.Channel", int, TopicMessages]] = field(default_factory=dict)
    server: Any = None

    def clear(self) -> None:
        self.last.clear()
        self.server.clear_session()

    def send(self, stamp: int, messages: list[TopicMessages]) -> None:
        for each in messages:
            channel = self.channels.get(each.topic) or self._open(each.topic, each.msgtype)
            self.last[channel.id()] = channel, stamp, each
            if channel.has_sinks():
                channel.log(each.encode()[0], log_time=stamp)
        self.server.broadcast_time(stamp)

    def _open(self, topic: str, msgtype: str) -> "foxglove.Channel":
        import foxglove

        definition, _ = standard_types().generate_msgdef(msgtype, ros_version=2)
        schema = foxglove.Schema(name=msgtype, encoding="ros2msg", data=definition.encode())
        channel = foxglove.Channel(topic, schema=schema, message_encoding="cdr", context=self.context)
        self.channels[topic] = channel
        return channel

    def on_unsubscribe(self, client: Any, channel: Any) -> None:
        """Called by the server where a client has seen enough of a topic."""

    def on_subscribe(self, client: Any, channel: Any) -> None:
        """Called by the server where a client begins to watch a topic."""
        if channel.id in self.last:
            known, stamp, messages = self.last[channel.id]
            known.log(messages.encode()[0], log_time=stamp)


_servers: dict[tuple[str, int], _Server] = {}


def _server(host: str, port: int) -> _Server:
    if (host, port) in _servers:
        return _servers[host, port]
    try:
        import foxglove
    except ImportError:
        raise BadInput("watch: foxglove-sdk is not installed: pip install 'omninav[live]'") from None
    made = _Server(foxglove.Context())
    try:
        made.server = foxglove.start_server(
            name="omninav",
            host=host,
            port=port,
            context=made.context,
            server_listener=made,  # type: ignore[arg-type]
            capabilities=[foxglove.Capability.Time],
        )
    except (RuntimeError, OSError, OverflowError) as error:
        raise BadInput(f"watch: {host}:{port} cannot be listened on ({error}); type watch=PORT for another") from None
    return _servers.setdefault((host, port), made)
