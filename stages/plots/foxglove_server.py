"""The WebSocket server that Foxglove connects to."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from omninav.pipeline import BadInput
from omninav.pipeline.mcap.message_types import standard_types

from .tick_messages import TopicMessages

if TYPE_CHECKING:
    import foxglove

PORT = 8765
"""Foxglove's own default."""


@dataclass
class FoxgloveServer:
    """A running server, its channels, and the stamp of the last message on each with what makes it."""

    context: Any
    channels: "dict[str, foxglove.Channel]" = field(default_factory=dict)
    last: dict[int, tuple["foxglove.Channel", int, TopicMessages]] = field(default_factory=dict)
    server: Any = None

    def clear(self) -> None:
        """Forget what was shown of an earlier run."""
        self.last.clear()
        self.server.clear_session()

    def send(self, stamp: int, messages: list[TopicMessages]) -> None:
        """Send messages at a time (ns) to all clients that watch their topics."""
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


_servers: dict[tuple[str, int], FoxgloveServer] = {}


def foxglove_server(host: str, port: int) -> FoxgloveServer:
    """The server at an address; a later run of the same process uses the same one. Raises `BadInput`."""
    if (host, port) in _servers:
        return _servers[host, port]
    try:
        import foxglove
    except ImportError:
        raise BadInput("watch: foxglove-sdk is not installed: pip install 'omninav[live]'") from None
    made = FoxgloveServer(foxglove.Context())
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
