"""ROS 2 messages over DDS, without ROS: CycloneDDS, with the messages' bytes as they are."""

import os
import threading
import time
from typing import Any
from xml.sax.saxutils import escape

from .transport import DEPTH, NEWEST_DEPTH, RawMessage, Transport, TransportError

FAST_DDS = "1.15"
"""The vendor whose type information CycloneDDS cannot match; with it ignored, types match by name."""
INCOMPATIBLE = {2: "durability", 4: "deadline", 8: "liveliness", 11: "reliability", 23: "data representation"}
"""DDS' numbers of the policies that ROS sets."""
POLL_NS = 200_000_000


def open_transport(domain: int) -> Transport:
    """A participant in a domain. Raises `TransportError` where the library is missing or the network refuses."""
    try:
        import cyclonedds.core  # noqa: F401
    except ImportError:
        raise TransportError("transport=dds needs CycloneDDS: pip install 'omninav[live]'") from None
    return DdsTransport(domain)


class DdsTransport(Transport):
    """A CycloneDDS participant whose readers and writers pass CDR as it is.

    Topics and types are named as ROS names them on DDS (`rt/odom`, `nav_msgs::msg::dds_::Odometry_`). It obeys
    `CYCLONEDDS_URI`, and of ROS `ROS_AUTOMATIC_DISCOVERY_RANGE` and `ROS_STATIC_PEERS`.
    """

    def __init__(self, domain: int) -> None:
        super().__init__()
        from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
        from cyclonedds.core import DDSException, InstanceState, ReadCondition, SampleState, ViewState, WaitSet
        from cyclonedds.domain import Domain, DomainParticipant

        settings = ",".join(filter(None, (os.environ.get("CYCLONEDDS_URI", ""), _settings())))
        try:
            self._domain = Domain(domain, settings)
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            raise TransportError(f"transport=dds: DDS domain {domain} cannot be opened ({error})") from None
        self._lock = threading.RLock()
        self._readers: dict[str, Any] = {}
        self._writers: dict[str, Any] = {}
        self._types: dict[str, str] = {}
        self._offers = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._alive = ReadCondition(self._offers, SampleState.Any | ViewState.Any | InstanceState.Alive)
        self._waitset = WaitSet(self._participant)
        self._closed = threading.Event()
        self._thread = threading.Thread(target=self._receive, name="dds", daemon=True)
        self._thread.start()

    def subscribe(self, topic: str, msgtype: str, newest: bool = False, latched: bool = False) -> None:
        from cyclonedds.core import InstanceState, ReadCondition, SampleState, ViewState
        from cyclonedds.qos import Policy, Qos
        from cyclonedds.sub import DataReader

        qos = Qos(
            Policy.Reliability.Reliable(0) if latched else Policy.Reliability.BestEffort,
            Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
            Policy.History.KeepLast(NEWEST_DEPTH if newest else DEPTH),
        )
        with self._lock:
            self.queue.open(topic, newest)
            reader = DataReader(self._participant, self._topic(topic, msgtype), qos)
            self._types[topic], self._readers[topic] = msgtype, reader
            self._waitset.attach(ReadCondition(reader, SampleState.Any | ViewState.Any | InstanceState.Any))

    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        from cyclonedds._clayer import ddspy_write

        with self._lock:
            if topic not in self._writers:
                self._writers[topic] = self._writer(topic, msgtype, latched)
        written = ddspy_write(self._writers[topic]._ref, data + b"\0" * (-len(data) % 4))
        if written < 0:
            raise TransportError(f"transport=dds: {topic}: a message could not be sent (DDS error {written})")

    def offered(self) -> dict[str, str]:
        found = {}
        for sample in self._offers.read(N=10_000, condition=self._alive):  # not of those that have left
            if getattr(sample, "participant_key", None) == self._participant.guid:
                continue
            topic, kind = getattr(sample, "topic_name", None), str(getattr(sample, "type_name", "")).split("::")
            if topic and topic.startswith("rt/") and len(kind) == 4:
                found[topic[2:]] = f"{kind[0]}/{kind[1]}/{kind[3].removesuffix('_')}"
        return found

    def mismatched(self) -> dict[str, str]:
        with self._lock:
            statuses = {
                topic: reader.get_requested_incompatible_qos_status() for topic, reader in self._readers.items()
            }
            statuses |= {topic: writer.get_offered_incompatible_qos_status() for topic, writer in self._writers.items()}
        return {
            topic: INCOMPATIBLE.get(status.last_policy_id, f"policy {status.last_policy_id}")
            for topic, status in statuses.items()
            if status.total_count
        }

    def close(self) -> None:
        self._closed.set()
        self._thread.join(timeout=2.0)
        with self._lock:
            self._readers.clear()
            self._writers.clear()
            for entity in (self._participant, self._domain):
                entity.__del__()

    def _topic(self, topic: str, msgtype: str) -> Any:
        """The DDS topic behind a ROS one, of an opaque type of the right name: what is in it passes unread."""
        from cyclonedds.idl import IdlStruct
        from cyclonedds.idl.types import uint8
        from cyclonedds.topic import Topic

        package, _, name = msgtype.split("/")

        class Opaque(IdlStruct, typename=f"{package}::msg::dds_::{name}_"):  # a keyword: as an attribute it is ignored
            first: uint8  # DDS checks what the type states, and lets pass what follows

        return Topic(self._participant, f"rt{topic}", Opaque)

    def _writer(self, topic: str, msgtype: str, latched: bool) -> Any:
        from cyclonedds.pub import DataWriter
        from cyclonedds.qos import Policy, Qos

        qos = Qos(
            Policy.Reliability.Reliable(100_000_000),  # 0.1 s: a reader that has hung does not stop the robot's pose
            Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
            Policy.History.KeepLast(1 if latched else 16),
        )
        return DataWriter(self._participant, self._topic(topic, msgtype), qos)

    def _receive(self) -> None:
        from cyclonedds._clayer import ddspy_take
        from cyclonedds.core import InstanceState, SampleState, ViewState

        everything = SampleState.Any | ViewState.Any | InstanceState.Any
        while not self._closed.is_set():
            self._waitset.wait(POLL_NS)
            with self._lock:
                readers = list(self._readers.items())
            for topic, reader in readers:
                samples = ddspy_take(reader._ref, everything, DEPTH)
                received = time.time_ns()
                for data, info in samples if isinstance(samples, list) else ():
                    if info.valid_data:
                        self.queue.put(RawMessage(topic, self._types[topic], received, bytes(data)))


def _settings() -> str:
    """CycloneDDS' configuration, so that ROS 2 finds us and our types match."""
    reach = os.environ.get("ROS_AUTOMATIC_DISCOVERY_RANGE", "").upper()
    peers = [peer for peer in os.environ.get("ROS_STATIC_PEERS", "").split(";") if peer]
    peers += ["localhost"] if reach == "LOCALHOST" else []
    listed = "".join(f'<Peer address="{escape(peer)}"/>' for peer in peers)
    discovery = f"<ParticipantIndex>auto</ParticipantIndex><Peers>{listed}</Peers>" if peers else ""
    discovery += "<MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>" if peers else ""
    discovery += f"<Tag>omninav_{os.getpid()}</Tag>" if reach == "OFF" else ""  # none but who has the same tag
    alone = "<General><AllowMulticast>false</AllowMulticast></General>" if reach in ("LOCALHOST", "OFF") else ""
    return (
        "<CycloneDDS><Domain>"
        f"<Compatibility><IgnoreTypeInformation>{FAST_DDS}</IgnoreTypeInformation></Compatibility>"
        f"{alone}{f'<Discovery>{discovery}</Discovery>' if discovery else ''}"
        "</Domain></CycloneDDS>"
    )
