"""ROS 2 messages over zenoh, without ROS: by the keys, tokens and attachments of rmw_zenoh."""

import json
import os
import struct
import threading
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

from omninav.pipeline.mcap.message_types import standard_types

from .transport import RawMessage, Transport, TransportError

ROUTER = "tcp/localhost:7447"
"""Address at which rmw_zenoh's sessions look for their router."""
VOLATILE, LATCHED = "::,16:,:,:,,", ":1:,1:,:,:,,"
"""QoS as tokens have it: reliable, volatile and the last 16 messages; transient local and the last one."""


def open_transport(domain: int) -> Transport:
    """A session in a domain. Raises `TransportError` where the library is missing or its configuration is wrong."""
    try:
        import zenoh  # noqa: F401
    except ImportError:
        raise TransportError("transport=zenoh needs zenoh: pip install 'omninav[zenoh]'") from None
    return ZenohTransport(domain)


class ZenohTransport(Transport):
    """A zenoh session that passes CDR as nodes with `RMW_IMPLEMENTATION=rmw_zenoh_cpp` do (Jazzy and later).

    Data has the key `domain/topic/type/hash`; a liveliness token of each node, publisher and subscription tells the
    others what there is; an attachment holds number, time (ns) and sender of a message. It follows rmw_zenoh:
    `ZENOH_SESSION_CONFIG_URI`, a file, and `ZENOH_CONFIG_OVERRIDE`, as `key=value;key=value`. Every QoS fits.
    """

    def __init__(self, domain: int) -> None:
        super().__init__()
        import zenoh

        try:
            self._session: Any = zenoh.open(_settings())
        except zenoh.ZError as error:
            raise TransportError(f"transport=zenoh: a session cannot be opened ({error!s:.200})") from None
        self._domain, self._id = domain, str(self._session.zid())
        self._lock = threading.RLock()
        self._publishers: dict[str, Any] = {}
        self._sent: Counter[str] = Counter()
        self._tokens: set[str] = set()
        self._counting = threading.Lock()
        liveliness = self._session.liveliness()
        heard = _directly(self._change)
        self._held: list[Any] = [liveliness.declare_subscriber(f"@ros2_lv/{domain}/**", heard, history=True)]
        self._declare("NN")

    def subscribe(self, topic: str, msgtype: str, newest: bool = False, latched: bool = False) -> None:
        from zenoh import ext

        self.queue.open(topic, newest)

        def receive(sample: Any) -> None:
            self.queue.put(RawMessage(topic, msgtype, time.time_ns(), sample.payload.to_bytes()))

        with self._lock:
            key = (
                f"{self._domain}{topic}/{_typed(msgtype).partition('/')[0]}/*"  # of whatever distribution, and so hash
            )
            history = ext.HistoryConfig(detect_late_publishers=True) if latched else None
            self._held.append(ext.declare_advanced_subscriber(self._session, key, _directly(receive), history=history))
            self._declare("MS", topic, msgtype, LATCHED if latched else VOLATILE)

    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        from zenoh import ext

        with self._lock:
            if topic not in self._publishers:
                key, cache = f"{self._domain}{topic}/{_typed(msgtype)}", ext.CacheConfig(1) if latched else None
                publisher = ext.declare_advanced_publisher(self._session, key, cache=cache, publisher_detection=latched)
                self._publishers[topic] = publisher
                self._declare("MP", topic, msgtype, LATCHED if latched else VOLATILE)
            self._sent[topic] += 1
            sender = bytes.fromhex(self._id.zfill(32))
            attachment = struct.pack("<qqB", self._sent[topic], time.time_ns(), len(sender)) + sender
            self._publishers[topic].put(data, attachment=attachment)

    def offered(self) -> dict[str, str]:
        with self._counting:
            tokens = [token.split("/") for token in self._tokens]
        found = {}
        for parts in tokens:
            kind = parts[10].split("::") if len(parts) == 13 else []
            if len(kind) == 4 and parts[5] == "MP" and parts[2] != self._id:
                found[parts[9].replace("%", "/")] = f"{kind[0]}/{kind[1]}/{kind[3].removesuffix('_')}"
        return found

    def unseen(self) -> str:
        known = self._session.info
        if known.routers_zid() or known.peers_zid():
            return super().unseen()
        return (
            "no router answers; type `ros2 run rmw_zenoh_cpp rmw_zenohd`, or where another one is: "
            f"export ZENOH_CONFIG_OVERRIDE='connect/endpoints=[\"{ROUTER}\"]'"
        )

    def close(self) -> None:
        self._session.close()

    def _declare(self, kind: str, topic: str = "", msgtype: str = "", qos: str = "") -> None:
        """Let the others know of the node (NN), or of a publisher (MP) or subscription (MS) of it."""
        number = len(self._held) if topic else 0
        token = f"@ros2_lv/{self._domain}/{self._id}/0/{number}/{kind}/%/%/omninav"
        token += f"/{topic.replace('/', '%')}/{_typed(msgtype)}/{qos}" if topic else ""
        self._held.append(self._session.liveliness().declare_token(token))

    def _change(self, sample: Any) -> None:
        import zenoh

        with self._counting:
            change = self._tokens.add if sample.kind == zenoh.SampleKind.PUT else self._tokens.discard
            change(str(sample.key_expr))


def _settings() -> Any:
    """A session's configuration as rmw_zenoh's: a peer that finds others through a router on this computer."""
    import zenoh

    file = os.environ.get("ZENOH_SESSION_CONFIG_URI")
    settings = zenoh.Config.from_file(file) if file else zenoh.Config()
    alone = {"connect/endpoints": json.dumps([ROUTER]), "scouting/multicast/enabled": "false"}
    ours = {"timestamping/enabled": "true"} | ({} if file else alone)
    given = (word.partition("=") for word in os.environ.get("ZENOH_CONFIG_OVERRIDE", "").split(";") if word)
    for key, value in {**ours, **{key: value for key, _, value in given}}.items():
        settings.insert_json5(key, value)
    return settings


def _directly(callback: Callable[[Any], None]) -> Any:
    """A callback in zenoh's own thread: one of Python's, which is zenoh's default, would outlive this process' work."""
    from zenoh import handlers

    return handlers.Callback(callback, indirect=False)


def _typed(msgtype: str) -> str:
    """A type in a key: its name on DDS, and the hash of its definition that distinguishes versions."""
    package, _, name = msgtype.split("/")
    return f"{package}::msg::dds_::{name}_/{standard_types().hash_rihs01(msgtype)}"
