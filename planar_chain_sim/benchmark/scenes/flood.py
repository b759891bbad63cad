"""A real node over real DDS under more commands than it can take, and under none. ROS 2."""
from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, sleep
from typing import Callable, Iterator, Optional

import numpy as np

from . import Check
from ...errors import Mistake
from ...recording.cdr import decode_joint_state, encode_float64_multi_array
from ...recording.log_reader import read_log
from ...resimulation.bits import resimulate

WAIT = 60.0   # s, after which a node that does not answer is given up


def messages(peers: dict, size: float) -> Iterator[Check]:
    """Flood a real node with commands from this process, then fall silent: no tick is lost, and nothing jumps."""
    count = int(1e5 * size)
    whats = (f'{count} commands as fast as they go, then silence: ticks lost', 'states that are not finite',
             'the newest of them acts: effort off, N m', 'after the publisher has left: effort, N m',
             'states that a run from the log does not repeat')
    try:
        measured, why = _flooded(count), ''
    except (ImportError, Mistake) as error:
        measured, why = (None,) * len(whats), f'ROS 2 cannot be used ({error})'
    for what, value in zip(whats, measured):
        yield Check(what, 0.0, value, why=why)


def _flooded(count: int) -> tuple:
    """Return what `messages` measures; ImportError: no ROS 2; Mistake: a node that does not answer."""
    import rclpy
    from rclpy.node import Node
    from rclpy.signals import SignalHandlerOptions
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    space, context = f'/stability_{os.getpid()}', rclpy.Context()
    with TemporaryDirectory() as folder:
        log = Path(folder, 'flood.mcap')
        process = subprocess.Popen(
            [sys.executable, '-m', 'planar_chain_sim.ros.node', '--ros-args', '-r', f'__ns:={space}',
             '-p', f'record:={log}'], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        rclpy.init(context=context, signal_handler_options=SignalHandlerOptions.NO)
        node = Node('flood', context=context)
        try:
            states = node.create_subscription(JointState, f'{space}/joint_states', _never_called, 10, raw=True)
            commands = node.create_publisher(Float64MultiArray, f'{space}/simulator/commands', 64)
            _wait(process, lambda: commands.get_subscription_count() and states.get_publisher_count())
            last = np.array([1.0, -1.0, 0.5, 0.25, 0.125])
            values = np.random.default_rng(2).normal(size=(1000, 5))
            values[::10, 3] = np.nan   # refused
            for k in range(count):
                commands.publish(bytes(encode_float64_multi_array(values[k % 1000])))
            commands.publish(bytes(encode_float64_multi_array(last)))
            acted = _wait(process, lambda: _effort(states, last))
            node.destroy_publisher(commands)
            rested = _wait(process, lambda: _effort(states, np.zeros(5)))
        finally:
            node.destroy_node()
            context.try_shutdown()
            process.send_signal(signal.SIGINT)
            process.wait(WAIT)
        recorded = read_log(log)
        ticks = [message for message in recorded.messages if message.topic == f'{space}/joint_states']
        bad = sum(not np.isfinite([state.position, state.velocity, state.effort]).all()
                  for state in (decode_joint_state(message.data) for message in ticks))
        verdict = resimulate(recorded)
    return (ticks[-1].sequence + 1 - len(ticks), bad, float(np.abs(acted - last).max()), float(np.abs(rested).max()),
            0 if verdict.difference is None else len(ticks) - verdict.states + 1)


def _never_called(message):
    """Do nothing: rclpy requires a callback, but messages are taken by hand."""


def _effort(states, wanted) -> Optional[np.ndarray]:
    """Return the effort of a state that has come if it is the wanted one."""
    with states.handle:
        taken = states.handle.take_message(states.msg_type, True)
    if taken is None:
        return None
    effort = np.array(decode_joint_state(taken[0]).effort)
    return effort if np.array_equal(effort, wanted) else None


def _wait(process, found: Callable):
    """Return what `found()` gives once it gives something; Mistake where the node ends or says nothing."""
    begun = monotonic()
    while True:
        value = found()
        if value is not None and value is not False and not (isinstance(value, int) and value == 0):
            return value
        if process.poll() is not None or monotonic() - begun > WAIT:
            raise Mistake('the simulator does not answer')
        sleep(1e-4)
