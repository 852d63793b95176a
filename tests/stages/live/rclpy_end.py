"""The other end of a live test: a ROS 2 node that does what lines of JSON say, in rclpy's own Python."""

import base64
import contextlib
import importlib
import json
import sys
import threading

import rclpy
from rclpy.executors import ExternalShutdownException
from rclpy.qos import DurabilityPolicy, QoSProfile


def type_of(name: str) -> type:
    package, kind, own = name.split("/")
    return getattr(importlib.import_module(f"{package}.{kind}"), own)


def say(**what: object) -> None:
    print(json.dumps(what), flush=True)


def qos_of(order: dict) -> QoSProfile:
    return QoSProfile(depth=10, durability=DurabilityPolicy[order.get("durability", "VOLATILE")])


def plain(value: object) -> object:
    """A message as mappings, lists and numbers."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: plain(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bool, int, float)):
        return value
    return [plain(each) for each in value.tolist()] if hasattr(value, "tolist") else [plain(each) for each in value]


def fill(message: object, fields: dict) -> object:
    for name, value in fields.items():
        setattr(message, name, fill(getattr(message, name), value) if isinstance(value, dict) else value)
    return message


def main() -> None:
    rclpy.init()
    node = rclpy.create_node("other_end")
    publishers, clients = {}, {}

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            rclpy.spin(node)

    def hear(topic: str) -> object:
        return lambda data: say(topic=topic, data=base64.b64encode(bytes(data)).decode())

    def tell(topic: str) -> object:
        return lambda message: say(topic=topic, message=plain(message))

    threading.Thread(target=spin, daemon=True).start()
    say(ready=True)
    for line in sys.stdin:
        order = json.loads(line)
        topic = order.get("topic", "")
        if order["do"] == "advertise":
            publishers[topic] = node.create_publisher(type_of(order["type"]), topic, qos_of(order))
        elif order["do"] == "publish":
            publishers[topic].publish(base64.b64decode(order["data"]))
        elif order["do"] == "subscribe" and order.get("decoded"):
            node.create_subscription(type_of(order["type"]), topic, tell(topic), qos_of(order))
        elif order["do"] == "subscribe":
            node.create_subscription(type_of(order["type"]), topic, hear(topic), qos_of(order), raw=True)
        elif order["do"] == "matched":
            say(matched=publishers[topic].get_subscription_count())
        elif order["do"] == "call":
            kind = type_of(order["type"])
            client = clients.setdefault(topic, node.create_client(kind, topic))
            there = client.wait_for_service(timeout_sec=60.0)
            future = client.call_async(fill(kind.Request(), order.get("request", {}))) if there else None
            if future is None:
                say(answer=None)
            else:
                future.add_done_callback(lambda done: say(answer=str(done.result())))
    rclpy.try_shutdown()


main()
