"""The executable `example_controller`: computed torque along a swing, to try and to start your own from."""
from __future__ import annotations

from contextlib import ExitStack
from math import cos, pi, sin
import sys
from typing import Any

from .process import run_until_stopped, start_node

DESCRIPTION = """\
Lead the simulator's arm along a swing by computed torque: each joint goes `amplitude` farther and comes back.

It answers every joint_states with efforts on simulator/joint_commands, in lockstep too. Parameters: chain_file, the one
that the simulator has; amplitude (rad; a slide gets a fifth of it in m), period (s), bandwidth (rad/s).
SIGINT and SIGTERM end it with exit code 0. A mistake ends it with one sentence and exit code 2."""
EXAMPLE = 'example_controller --ros-args -p amplitude:=0.8 -p period:=3.0'
PATIENCE = 2.0  # s of wall time after which a missing simulator is reported
REPORT_PERIOD = 2.0  # s of stamped time between two sentences about the error


class ComputedTorque:
    """
    Efforts that make the error to a swing vanish like e'' + 2 w e' + w^2 e = 0, by inverse dynamics of `chain`.

    `bandwidth`: w, rad/s. The swing starts at the state that is seen first.
    """

    def __init__(self, chain, amplitude: float, period: float, bandwidth: float):
        import numpy as np
        self._chain, self._rate, self._bandwidth = chain, 2.0 * pi / period, bandwidth
        self._reach = np.array([amplitude if joint.kind == 'rotation' else 0.2 * amplitude for joint in chain.joints])
        self._start: Any = None  # time and positions

    def reference(self, time: float):
        """Return wanted positions, velocities and accelerations (joints,) at a time, s, after the first state."""
        start, origin = self._start
        angle, rate, reach = self._rate * (time - start), self._rate, 0.5 * self._reach
        return (origin + reach * (1.0 - cos(angle)), reach * rate * sin(angle), reach * rate**2 * cos(angle))

    def effort(self, time: float, position, velocity):
        """Return the efforts (joints,), N m or N, at a state of this time, s, and the error of position (joints,)."""
        from ..mechanics.dynamics import inverse_dynamics
        if self._start is None:
            self._start = time, position
        wanted, wanted_velocity, wanted_acceleration = self.reference(time)
        error = wanted - position
        acceleration = (wanted_acceleration + 2.0 * self._bandwidth * (wanted_velocity - velocity)
                        + self._bandwidth**2 * error)
        return inverse_dynamics(self._chain, position, velocity, acceleration), error


def main(arguments=None) -> int:
    """Run the executable. Its stop signals are handled before anything heavy is imported."""
    return run_until_stopped('example_controller', control, arguments)


def control(own_arguments, ros_arguments, stop) -> None:
    """Answer states until something is put into `stop`. Mistake: bad arguments, parameters or chain."""
    from ..command_line import Parser
    from ..errors import Mistake
    Parser('example_controller', DESCRIPTION, EXAMPLE).parse_args(own_arguments)
    with ExitStack() as ending:
        node = start_node('example_controller', ros_arguments, ending)
        from rclpy.executors import SingleThreadedExecutor

        from ..errors import ChainError
        try:
            answer_states(node, *controller_of(node))
        except ChainError as error:
            raise Mistake(str(error)) from None
        executor = SingleThreadedExecutor(context=node.context)
        executor.add_node(node)
        ending.callback(executor.shutdown)
        while stop.empty():
            executor.spin_once(timeout_sec=0.1)


def controller_of(node):
    """Return the controller that the node's parameters want, and its chain; Mistake or ChainError."""
    from .declaration import declare, given_values
    from .parameters import Row
    from ..chain_file import load_chain
    rows = (Row('chain_file', 'four_link_robot.yaml', 'Chain file that the simulator has.'),
            Row('hold', [], 'Joints of it that are welded, as the simulator has it.'),
            Row('amplitude', 0.5, 'Swing of a rotation, rad; a slide swings a fifth of it, m.', (-100.0, 100.0)),
            Row('period', 4.0, 'Period of the swing, s.', (0.01, 1e4)),
            Row('bandwidth', 15.0, 'How fast errors vanish, rad/s.', (0.01, 1e4)))
    values = given_values(node, rows)
    declare(node, values, {row.name: row for row in rows})
    chain = load_chain(values.pop('chain_file'), values.pop('hold'))
    return ComputedTorque(chain, **values), chain


def answer_states(node, controller: ComputedTorque, chain) -> None:
    """Subscribe to the states and answer each; log the largest error now and then."""
    import numpy as np
    from rclpy.clock import Clock, ClockType
    from sensor_msgs.msg import JointState
    publisher = node.create_publisher(JointState, 'simulator/joint_commands', 10)
    worst, told = 0.0, None

    def answer(state):
        nonlocal worst, told
        if tuple(state.name) != chain.joint_names:
            node.get_logger().error(f'the states are of the joints {", ".join(state.name)}, must be those of '
                                    f'{chain.name}: {", ".join(chain.joint_names)}', once=True)
            return
        time = state.header.stamp.sec + state.header.stamp.nanosec * 1e-9
        effort, error = controller.effort(time, np.array(state.position), np.array(state.velocity))
        # The state's own header: in lockstep that is how a command says which state it answers.
        publisher.publish(JointState(header=state.header, name=state.name, effort=effort.tolist()))
        worst, told = max(worst, float(abs(error).max())), time if told is None else told
        if time - told >= REPORT_PERIOD:
            node.get_logger().info(f'largest error of the last {REPORT_PERIOD:g} s: {worst:.2g} rad or m')
            worst, told = 0.0, time

    # In real time only the newest state needs an answer. Lockstep waits for the answer before the next state.
    subscription = node.create_subscription(JointState, 'joint_states', answer, 1)

    def warn_of_missing_nodes():
        timer.cancel()
        if told is None and not subscription.get_publisher_count():
            node.get_logger().warning(f'no joint_states on {subscription.topic_name} yet, is a simulator in this '
                                      'namespace?')
        if not publisher.get_subscription_count():
            node.get_logger().warning(f'nobody takes efforts on {publisher.topic_name}, has the simulator another '
                                      'name?')
    timer = node.create_timer(PATIENCE, warn_of_missing_nodes, clock=Clock(clock_type=ClockType.STEADY_TIME))


if __name__ == '__main__':
    sys.exit(main())
