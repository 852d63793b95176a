"""The services of nav2's AMCL, by its names, where a transport has services."""

import time
from collections.abc import Callable

from omninav.pipeline.mcap.message_types import encode_message, standard_types

from .transport import RawMessage, Transport, TransportError, full_name

EMPTY, POSE = "std_msgs/msg/Empty", "geometry_msgs/msg/PoseWithCovarianceStamped"
NOTHING = b"\0\1\0\0\0"
"""An Empty message in CDR."""
UNCONFIGURED, INACTIVE, ACTIVE, FINALIZED = (1, "unconfigured"), (2, "inactive"), (3, "active"), (4, "finalized")
STATE_AFTER = {1: INACTIVE, 2: UNCONFIGURED, 3: ACTIVE, 4: INACTIVE, 5: FINALIZED, 6: FINALIZED, 7: FINALIZED}
"""The lifecycle state after a transition, by its id."""


def serve_restart(transport: Transport, service: str) -> None:
    """A call is as good as a message on the topic of that name: the belief starts again, uniform."""

    def restart(_: bytes) -> bytes:
        transport.queue.put(RawMessage(full_name(service), EMPTY, time.time_ns(), NOTHING))
        return NOTHING

    _serve(transport, service, "std_srvs/srv/Empty", restart)


def serve_amcl(transport: Transport, node: str, initial_pose: str | None) -> None:
    """Serves what AMCL answers besides: an update without motion, an initial pose, and its lifecycle.

    `node`: AMCL's name, in the lifecycle services' names. `initial_pose`: the topic that a pose is as good as.
    """
    state = ACTIVE

    def set_pose(request: bytes) -> bytes:
        assert initial_pose is not None
        # The request is that message.
        transport.queue.put(RawMessage(full_name(initial_pose), POSE, time.time_ns(), request))
        return NOTHING

    def get_state(_: bytes) -> bytes:
        return encode_message("lifecycle_msgs/msg/State", dict(zip(("id", "label"), state, strict=True)))

    def change_state(request: bytes) -> bytes:
        nonlocal state
        transition = standard_types().deserialize_cdr(request, "lifecycle_msgs/msg/Transition").id  # type: ignore[attr-defined]
        known = transition in STATE_AFTER
        state = STATE_AFTER.get(transition, state)
        return encode_message("std_msgs/msg/Bool", {"data": known})

    # Every image is an update, in motion or not.
    _serve(transport, "/request_nomotion_update", "std_srvs/srv/Empty", lambda _: NOTHING)
    if initial_pose is not None:
        _serve(transport, "/set_initial_pose", "nav2_msgs/srv/SetInitialPose", set_pose)
    _serve(transport, f"/{node}/get_state", "lifecycle_msgs/srv/GetState", get_state)
    _serve(transport, f"/{node}/change_state", "lifecycle_msgs/srv/ChangeState", change_state)


def _serve(transport: Transport, service: str, srvtype: str, answer: Callable[[bytes], bytes]) -> None:
    try:
        transport.serve(service, srvtype, answer)
    except TransportError as error:  # a ROS without these messages
        transport.status.left_out[service] = str(error)
