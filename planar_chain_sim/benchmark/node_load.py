"""What the node costs and how punctual it is: a real simulator process over DDS, watched from here. Linux, ROS 2."""
from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic, sleep
from typing import Iterator

import numpy as np

from ..command_line import Mistake
from ..recording.log_reader import read_log

COLUMNS = ('quantity', 'median', 'lowest', 'highest', 'unit')
STARTS = 5
WATCHED = 10.0   # s of steady running over which CPU time and lateness are taken
WAIT = 20.0      # s, after which a node that says nothing is given up


def node_load() -> Iterator[tuple]:
    """Yield rows of COLUMNS: start-up, CPU share, lateness of the node at 1 kHz, recording, one remote subscriber."""
    try:
        import rclpy
        from rclpy.executors import SingleThreadedExecutor
        from rclpy.node import Node
        from sensor_msgs.msg import JointState
    except ImportError as error:
        raise Mistake(f'the node is measured with ROS 2, which cannot be loaded ({error})') from None
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    rclpy.init()
    node = Node('benchmark_observer')
    seen = []
    node.create_subscription(JointState, 'joint_states', lambda message: seen.append(monotonic()), 10, raw=True)
    executor = SingleThreadedExecutor()
    executor.add_node(node)
    spinning = Thread(target=executor.spin)
    spinning.start()
    try:
        with TemporaryDirectory() as folder:
            yield from _measure(seen, Path(folder))
    finally:
        executor.shutdown()
        spinning.join()
        node.destroy_node()
        rclpy.try_shutdown()


def _measure(seen: list, folder: Path) -> Iterator[tuple]:
    starts, shares, late = [], [], []
    for k in range(STARTS):
        log = folder / f'{k}.mcap'
        seen.clear()
        began = monotonic()
        process = subprocess.Popen(
            [sys.executable, '-m', 'planar_chain_sim.ros.node', '--ros-args', '-p', f'record:={log}'],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
        try:
            while not seen:
                if process.poll() is not None or monotonic() - began > WAIT:
                    raise Mistake(f'the simulator did not start: {process.stderr.read().decode().strip()}')
                sleep(1e-3)
            starts.append(seen[0] - began)
            if k == STARTS - 1:
                sleep(1.0)
                before, mark = _cpu_time(process.pid), monotonic()
                sleep(WATCHED)
                shares.append((_cpu_time(process.pid) - before) / (monotonic() - mark) * 100.0)
        finally:
            process.send_signal(signal.SIGINT)
            process.communicate(timeout=WAIT)
        if k == STARTS - 1:
            states = [message for message in read_log(log).messages if message.topic == '/joint_states']
            late = np.array([message.log_time - message.publish_time for message in states][1000:]) * 1e-3
            lost = states[-1].sequence + 1 - len(states)
    yield 'process start to first joint_states in another process', *_spread(starts, 1e3), 'ms'
    yield 'CPU share at 1 kHz, recording, one remote subscriber', *_spread(shares, 1.0), '% of a core'
    yield 'state published after its tick was due, p50', np.percentile(late, 50), late.min(), late.max(), 'us'
    yield 'state published after its tick was due, p99', np.percentile(late, 99), late.min(), late.max(), 'us'
    yield 'ticks lost in the log', lost, lost, lost, f'of {len(states)}'


def _spread(values: list, scale: float) -> tuple:
    return np.median(values) * scale, min(values) * scale, max(values) * scale


def _cpu_time(process: int) -> float:
    """User and system time of all threads of a process so far, s: proc(5), fields 14 and 15."""
    fields = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
