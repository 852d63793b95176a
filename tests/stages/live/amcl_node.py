"""omninav's end of the AMCL test, in rclpy's own Python: what it is told, it says on its output."""

import itertools

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.live.amcl_services import serve_amcl, serve_restart
from omninav.stages.live.publish import Publish
from omninav.stages.live.time_synchronizer import TimeSynchronizer
from omninav.stages.live.transport import connect
from omninav.stages.recordings.live_record import LiveHeader, OdometryBuffer
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Pose

transport = connect("rclpy")
header = LiveHeader({"/initialpose": "initial_pose", "/reinitialize_global_localization": "restart"})
drive = OdometryBuffer(header)
synchronizer = TimeSynchronizer(transport, transport.status, header, drive, None, None, 1.0)
synchronizer.subscribe()
serve_restart(transport, "/reinitialize_global_localization")
serve_amcl(transport, "amcl", "/initialpose")
transport.status.live = True
publish, ctx = Publish(transport="rclpy", pose="/amcl_pose", tf=None), Context("publish")
publish.setup(ctx)
belief = Particles(np.array([[1.0, 2.0, 0.5]]), np.ones(1))
print("ready", flush=True)
for number in itertools.count():  # until it is killed
    publish.step(ctx, Tick(number, number + 1), estimate=belief.estimate(), odometry=Pose(0.0, 0.0, 0.0))
    synchronizer.next(0.1)
    made = drive.frame(number)
    if made is not None and made[0].restart is not None:
        print("restart", made[0].restart.at, flush=True)
