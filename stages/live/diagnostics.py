"""A live run's state as `diagnostic_msgs/DiagnosticArray`."""

import time

from omninav.pipeline.mcap.message_types import encode_message

from .publish import send
from .transport import Transport

TYPE = "diagnostic_msgs/msg/DiagnosticArray"
OK, WARN = 0, 1


def publish_diagnostics(transport: Transport, topic: str) -> None:
    """Publish the transport's status: latency, rate, what was left out, and every trouble in words."""
    status = transport.status
    troubles = "; ".join(sorted(status.troubles.values()))
    values = {"rate_hz": f"{status.rate_hz:.2f}", "spread_m": f"{status.spread_m:.3f}"}
    if status.latencies_ms is not None:
        values["latency_ms.median"], values["latency_ms.p95"] = (f"{each:.1f}" for each in status.latencies_ms)
    if status.age_ms is not None:
        values["age_ms.median"] = f"{status.age_ms:.1f}"
    values |= {kind: str(number) for kind, number in sorted(status.counts.items())}
    values |= {f"left out: {what}": why for what, why in sorted(status.left_out.items())}
    state = {
        "level": WARN if troubles else OK,
        "name": "omninav",
        "message": troubles or "running",
        "hardware_id": "",
        "values": [{"key": key, "value": value} for key, value in values.items()],
    }
    send(transport, topic, TYPE, encode_message(TYPE, {"status": [state]}, time.time_ns()))
