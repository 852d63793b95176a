"""Transport of ROS 2 messages to and from a robot: bytes in, bytes out, and who is at the other end."""

import atexit
import importlib
import os
import re
import threading
from abc import ABC, abstractmethod
from collections import Counter, deque
from collections.abc import Callable
from contextlib import suppress
from typing import Literal, NamedTuple, TypeVar

from omninav.pipeline import BadInput

from .status import LiveStatus

TransportName = Literal["dds", "rclpy", "ros2", "zenoh"]
"""`dds`: CycloneDDS, no ROS needed (`pip install 'omninav[live]'`). `rclpy` or `ros2`: a sourced ROS 2, or
`omninav[ros2]`. `zenoh`: a robot with rmw_zenoh, no ROS needed (`omninav[zenoh]`)."""
DEPTH, NEWEST_DEPTH = 1000, 16
"""Messages of a topic that DDS keeps until our thread takes them: all of them, or only the newest are wanted."""
MAX_WAITING = 10_000
"""Messages of one topic that wait to be taken; of more the oldest is overtaken. A minute of odometry at 150 Hz."""
NAME = re.compile(r"/?[\w:]+(/\w+)*", re.ASCII)
"""Pattern of the names of topics, and of frames in transforms (`/tf:map:base_link`)."""


class TransportError(BadInput):
    """A transport that cannot be opened or used. The message is one line: what, and what to type."""


class RawMessage(NamedTuple):
    """A message as it came: `received` in ns since 1970 by this computer's clock, `data` in CDR with its header."""

    topic: str
    msgtype: str
    received: int
    data: bytes


class MessageQueue:
    """Messages between the transport's thread and the one that takes them: bounded, whatever the taker does."""

    def __init__(self) -> None:
        self.overtaken: Counter[str] = Counter()
        """Number of messages of each topic that later ones overtook before they were taken."""
        self._changed = threading.Condition()
        self._messages: dict[str, deque[RawMessage]] = {}

    def open(self, topic: str, newest: bool) -> None:
        """Make room for a topic: for its newest message alone, or for all up to `MAX_WAITING`."""
        self._messages[topic] = deque(maxlen=1 if newest else MAX_WAITING)

    def put(self, message: RawMessage) -> None:
        """Keep a message; where there is no room the oldest of its topic is overtaken."""
        with self._changed:
            waiting = self._messages[message.topic]
            if len(waiting) == waiting.maxlen:
                self.overtaken[message.topic] += 1
            waiting.append(message)
            self._changed.notify()

    def take(self, timeout_s: float) -> RawMessage | None:
        """The message that was received first of those that wait; None where none comes in time."""
        with self._changed:
            self._changed.wait_for(lambda: any(self._messages.values()), timeout_s)
            waiting = [messages for messages in self._messages.values() if messages]
            return min(waiting, key=lambda messages: messages[0].received).popleft() if waiting else None


class Transport(ABC):
    """A connection to the messages of a ROS 2 domain. Types are ROS names (`nav_msgs/msg/Odometry`).

    Messages are received in a thread of the transport's own. All methods may be called from any thread.
    """

    def __init__(self) -> None:
        self.queue, self.status = MessageQueue(), LiveStatus()
        self.place = ""
        """Place where it listens, for messages: the transport and its domain."""
        self.farewells: list[Callable[[], None]] = []
        """Senders of what must still go out before the transport is closed."""

    @abstractmethod
    def subscribe(self, topic: str, msgtype: str, newest: bool = False, latched: bool = False) -> None:
        """Receive a topic from now on. `newest`: only its last message waits, and overtaken ones are counted.
        `latched`: the last ones before, too (transient local).

        Else best effort and volatile, which every publisher's QoS fits. Raises `TransportError` for an unknown type.
        """

    @abstractmethod
    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        """Send a message in CDR. `latched`: later subscribers get the last one too (transient local).

        Reliable. The first message of a topic announces it; peers match only then.
        """

    @abstractmethod
    def offered(self) -> dict[str, str]:
        """Topics that others publish now, with their types."""

    def mismatched(self) -> dict[str, str]:
        """Topics of ours whose other end requests or offers another QoS: topic -> which policy."""
        return {}

    def unseen(self) -> str:
        """Say why no publisher may be seen, and what to do."""
        return "is the robot on, and in the same domain and reach?"

    def serve(self, service: str, srvtype: str, answer: Callable[[bytes], bytes]) -> bool:
        """Answer a service, with requests and answers in CDR; False where the transport has no services."""
        return False

    def take(self, timeout_s: float = 0.0) -> RawMessage | None:
        """The message that was received first of those that wait; None where none comes in time."""
        return self.queue.take(timeout_s)

    @property
    def ended(self) -> bool:
        """Tells whether nothing will come any more. A robot may always send more."""
        return False

    @abstractmethod
    def close(self) -> None:
        """Leave the domain. Nothing can be received or sent any more."""


Opened = TypeVar("Opened", bound=Transport)
_OPEN: dict[tuple[str, int | str], Transport] = {}


def connect(transport: TransportName, domain: int | None = None) -> Transport:
    """The transport of this process: one for each domain, opened when it is first asked for.

    `domain`: the ROS domain; None: `ROS_DOMAIN_ID`, else 0. Raises `TransportError` where its library is missing.
    """
    number = _domain() if domain is None else domain
    transport = "rclpy" if transport == "ros2" else transport
    module = importlib.import_module(f"{__package__}.{transport}_transport")
    made: Transport = opened((transport, number), lambda: module.open_transport(number))
    made.place = f"transport={transport}, ROS_DOMAIN_ID={number}"
    return made


def opened(key: tuple[str, int | str], make: Callable[[], Opened]) -> Opened:
    """The transport of this process by that key, made when it is first asked for.

    All of a process have one status: what is known of a run is known to whatever publishes it.
    """
    if key not in _OPEN:
        made = make()
        for other in _OPEN.values():
            made.status = other.status
        _OPEN[key] = made
    return _OPEN[key]  # type: ignore[return-value]  # a key names its class


def full_name(topic: str) -> str:
    """A topic's name as ROS resolves it: `scan` is `/scan`. Raises `TransportError` for what is none."""
    if not NAME.fullmatch(topic):
        raise TransportError(f"{topic!r:.80}: no topic has such a name; type one as /camera/image (a-z, 0-9, _ and /)")
    return topic if topic.startswith("/") else f"/{topic}"


def disconnect() -> None:
    """Close all transports of this process."""
    while _OPEN:
        transport = _OPEN.popitem()[1]
        for farewell in transport.farewells:
            with suppress(Exception):  # whatever fails, the next one is sent
                farewell()
        transport.close()


atexit.register(disconnect)


def _domain() -> int:
    text = os.environ.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not text.isdecimal() or int(text) > 232:
        raise TransportError(f"ROS_DOMAIN_ID={text:.20}: expected a whole number from 0 to 232")
    return int(text)
