"""ROS 2 messages through rclpy: a sourced ROS 2, or its wheels."""

import importlib
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from .transport import DEPTH, NEWEST_DEPTH, RawMessage, Transport, TransportError


def open_transport(domain: int) -> Transport:
    """A node in a domain. Raises `TransportError` where rclpy is missing."""
    try:
        import rclpy  # noqa: F401
    except ImportError as error:
        raise TransportError(
            f"transport=rclpy needs ROS 2 ({error!s:.100}): source its setup.bash with the Python that it was built "
            "for, or pip install 'omninav[ros2]' with Python 3.11"
        ) from None
    try:
        return RclpyTransport(domain)
    except Exception as error:  # a keystore that is missing, no RMW: rclpy's own errors are of no common class
        raise TransportError(f"transport=rclpy: domain {domain} cannot be joined ({error!s:.300})") from None


class RclpyTransport(Transport):
    """The node `omninav_live`, spun in a thread; messages pass as CDR."""

    def __init__(self, domain: int) -> None:
        super().__init__()
        import rclpy
        from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = rclpy.create_node("omninav_live", context=self._context, enable_rosout=False)
        self._lock = threading.RLock()
        self._publishers: dict[str, Any] = {}
        self._mismatched: dict[str, str] = {}
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)

        def spin() -> None:
            with suppress(ExternalShutdownException):
                self._executor.spin()

        self._thread = threading.Thread(target=spin, name="rclpy", daemon=True)
        self._thread.start()

    def subscribe(self, topic: str, msgtype: str, newest: bool = False, latched: bool = False) -> None:
        from rclpy.event_handler import SubscriptionEventCallbacks
        from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy

        qos = QoSProfile(
            depth=NEWEST_DEPTH if newest else DEPTH,
            reliability=QoSReliabilityPolicy.RELIABLE if latched else QoSReliabilityPolicy.BEST_EFFORT,
            durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
        )
        self.queue.open(topic, newest)

        def receive(data: bytes) -> None:
            self.queue.put(RawMessage(topic, msgtype, time.time_ns(), bytes(data)))

        events = SubscriptionEventCallbacks(incompatible_qos=lambda event: self._note_mismatch(topic, event))
        with self._lock:
            self._node.create_subscription(
                _resolve(msgtype, topic), topic, receive, qos, raw=True, event_callbacks=events
            )
        self._executor.wake()

    def publish(self, topic: str, msgtype: str, data: bytes, latched: bool = False) -> None:
        with self._lock:
            if topic not in self._publishers:
                self._publishers[topic] = self._publisher(topic, msgtype, latched)
        self._publishers[topic].publish(data)

    def offered(self) -> dict[str, str]:
        found = {}
        for topic, _ in self._node.get_topic_names_and_types():
            for end in self._node.get_publishers_info_by_topic(topic):
                if (end.node_namespace, end.node_name) != (self._node.get_namespace(), self._node.get_name()):
                    found[topic] = end.topic_type
        return found

    def mismatched(self) -> dict[str, str]:
        with self._lock:
            return dict(self._mismatched)

    def serve(self, service: str, srvtype: str, answer: Callable[[bytes], bytes]) -> bool:
        from rclpy.serialization import deserialize_message, serialize_message

        kind = _resolve(srvtype, service)

        def reply(request: Any, _: Any) -> Any:
            return deserialize_message(answer(serialize_message(request)), kind.Response)

        with self._lock:
            self._node.create_service(kind, service, reply)
        self._executor.wake()
        return True

    def close(self) -> None:
        self._executor.shutdown(timeout_sec=2.0)
        self._thread.join(timeout=2.0)
        self._node.destroy_node()
        self._context.try_shutdown()

    def _publisher(self, topic: str, msgtype: str, latched: bool) -> Any:
        from rclpy.event_handler import PublisherEventCallbacks
        from rclpy.qos import QoSDurabilityPolicy, QoSProfile

        qos = QoSProfile(
            depth=1 if latched else 16,
            durability=QoSDurabilityPolicy.TRANSIENT_LOCAL if latched else QoSDurabilityPolicy.VOLATILE,
        )
        events = PublisherEventCallbacks(incompatible_qos=lambda event: self._note_mismatch(topic, event))
        return self._node.create_publisher(_resolve(msgtype, topic), topic, qos, event_callbacks=events)

    def _note_mismatch(self, topic: str, event: Any) -> None:
        policy = getattr(event.last_policy_kind, "name", str(event.last_policy_kind))
        with self._lock:
            self._mismatched[topic] = policy.lower().replace("_", " ")


def _resolve(name: str, topic: str) -> Any:
    """The class of a message or service type by its ROS name."""
    package, kind, name_in_it = name.split("/")
    try:
        return getattr(importlib.import_module(f"{package}.{kind}"), name_in_it)
    except (ImportError, AttributeError):
        raise TransportError(
            f"transport=rclpy: {topic}: the type {name} is not installed; install ros-…-{package.replace('_', '-')}"
        ) from None
