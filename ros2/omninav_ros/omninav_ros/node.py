"""The lifecycle node: it checks, starts and ends a run of omninav, and says whether the robot is localised."""

import os
import time

import rclpy
from rcl_interfaces.msg import ParameterDescriptor
from rclpy.executors import ExternalShutdownException
from rclpy.lifecycle import LifecycleState, Node, TransitionCallbackReturn
from rclpy.qos import QoSDurabilityPolicy, QoSProfile
from std_msgs.msg import Float64, String
from std_srvs.srv import Trigger

from omninav.pipeline.cli.arguments import value_text

from .parameters import AUTOSTART, OVERRIDES, PARAMETERS
from .run import Run

SUCCESS, FAILURE = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE
WATCH_S = 0.5
"""Seconds between two looks at whether the run still lives."""
STALE_S = 3.0
"""Age from which on a state says nothing of the robot now, seconds."""


class OmninavNode(Node):
    """`omninav live transport=rclpy` as a lifecycle node.

    configure: the settings are checked, and what is wrong with them is logged. activate: the run begins, and looks for
    the robot in the whole map. deactivate, shut down: the run ends as by Ctrl-C. A run that ends by itself leaves the
    node inactive. `~/is_localized` (Trigger) succeeds while the robot is tracked, by a variant that has a confidence.
    """

    def __init__(self) -> None:
        super().__init__("omninav")
        for name, (_, default, description) in PARAMETERS.items():
            self.declare_parameter(name, default, ParameterDescriptor(description=description))
        # whoever reaches the domain can set a parameter, and a setting can name a stage: code
        self.declare_parameter("overrides", [""], ParameterDescriptor(description=OVERRIDES, read_only=True))
        self.declare_parameter("autostart_node", False, ParameterDescriptor(description=AUTOSTART, read_only=True))
        self._run: Run | None = None
        self._active = False
        self._heard: float | None = None
        self._forget()
        latched = QoSProfile(depth=1, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL)
        self.create_subscription(String, "/estimate/state", self._hear_state, latched)
        self.create_subscription(Float64, "/estimate/confidence", self._hear_confidence, latched)
        self.create_service(Trigger, "~/is_localized", self._say_whether_localised)
        self.create_timer(WATCH_S, self._watch)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Check the settings in the process that will run."""
        return self._prepare()

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin a run, in a new process where the last one has ended."""
        if (self._run is None or self._run.ended is not None) and self._prepare() != SUCCESS:
            return FAILURE
        assert self._run is not None
        self._forget()
        self._run.go()
        self._active = True
        return SUCCESS

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the run."""
        self.end()
        return SUCCESS

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the process that waits."""
        self.end()
        return SUCCESS

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the run."""
        self.end()
        return SUCCESS

    def end(self) -> None:
        """End the run, if there is one."""
        run, self._run, self._active = self._run, None, False
        if run is not None:
            run.end()

    def _prepare(self) -> TransitionCallbackReturn:
        run = Run(self._words(), self._log)
        problems = run.problems()
        if problems:
            self.get_logger().error(problems)
            run.end()
            return FAILURE
        self._run = run
        return SUCCESS

    def _words(self) -> list[str]:
        """The settings as they are typed behind `omninav live`."""
        texts = {setting: self.get_parameter(name).value for name, (setting, _, _) in PARAMETERS.items()}
        typed = [f"{setting}={value_text(os.path.expanduser(text))}" for setting, text in texts.items() if text]
        return ["transport=rclpy", *typed, *filter(None, self.get_parameter("overrides").value)]

    def _watch(self) -> None:
        code = None if self._run is None else self._run.ended
        if code is not None:
            say = self.get_logger().error if code else self.get_logger().info
            say(f"the run has ended with exit code {code}")
            if self._active:
                self.trigger_deactivate()
            self.end()

    def _log(self, line: str) -> None:
        if line.startswith("{"):  # progress for programs; diagnostics have the same
            self.get_logger().debug(line)
        elif line.startswith("warning"):
            self.get_logger().warning(line.removeprefix("warning: "))
        else:
            self.get_logger().info(line)

    def _forget(self) -> None:
        self._state, self._confidence, self._heard = "searching", 0.0, None

    def _hear_state(self, message: String) -> None:
        self._state = message.data

    def _hear_confidence(self, message: Float64) -> None:
        self._confidence, self._heard = message.data, time.monotonic()

    def _say_whether_localised(self, request: Trigger.Request, answer: Trigger.Response) -> Trigger.Response:
        age = 0.0 if self._heard is None else time.monotonic() - self._heard
        if not self._active:
            answer.message = "no run: the node is not active"
        elif self._heard is None:
            answer.message = "searching, nothing has been estimated yet"
        elif age > STALE_S:
            answer.message = f"{self._state} {age:.0f} s ago, nothing has been estimated since"
        else:
            answer.success = self._state == "tracking"
            answer.message = f"{self._state}, confidence {self._confidence:.2f}"
        return answer


def main() -> None:
    """Spin the node until it is told to stop."""
    rclpy.init()
    node = OmninavNode()
    try:
        if node.get_parameter("autostart_node").value and node.trigger_configure() == SUCCESS:
            node.trigger_activate()
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    finally:
        node.end()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
