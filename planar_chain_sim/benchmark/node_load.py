"""CPU share and lateness of the node: a real simulator process over DDS, observed by this process. Linux, ROS 2."""
from __future__ import annotations

import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from threading import Thread
from time import monotonic, monotonic_ns, sleep, thread_time, time_ns
from typing import Iterator

import numpy as np

from ..errors import Mistake
from ..recording.log_reader import read_log
from ..ros.pacing import wake_punctually

COLUMNS = ('quantity', 'median', 'lowest', 'highest', 'unit')
STARTS = 5
WATCHED = 10.0   # s of steady running over which CPU time and lateness are taken
WAIT = 20.0      # s, after which a node that says nothing is given up


class Observer:
    """A subscriber to joint_states in this process, with a DDS participant of its own; `seen`: arrival times, s."""

    def __init__(self):
        try:
            import rclpy
            from rclpy.executors import SingleThreadedExecutor
            from rclpy.node import Node
            from sensor_msgs.msg import JointState
        except ImportError as error:
            raise Mistake(f'the node is measured with ROS 2, which cannot be loaded ({error})') from None
        self.seen = []
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = Node('benchmark_observer', context=self._context)
        self._node.create_subscription(JointState, 'joint_states', lambda message: self.seen.append(monotonic()), 10,
                                       raw=True)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self._node)
        self._thread = Thread(target=self._executor.spin)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *exception):
        self.leave()

    def leave(self):
        """End the subscription, the thread and the participant; nothing happens a second time."""
        if not self._thread.is_alive():
            return
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        self._context.try_shutdown()


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """
    Yield rows of COLUMNS: start-up, CPU share, lateness of the node at 1 kHz, recording, one remote subscriber.

    `quick`: fewer starts, watched for a shorter time.
    """
    starts, watched = (2, 2.0) if quick else (STARTS, WATCHED)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    own, other = [], []
    with TemporaryDirectory() as folder:
        for k in range(starts):
            log = Path(folder, f'{k}.mcap')
            with Observer() as observer:
                began, began_wall = monotonic(), time_ns()
                shares = _run(log, observer, watched if k == starts - 1 else 0.0)
            states = [message for message in read_log(log).messages if message.topic == '/joint_states']
            own.append((states[0].log_time - began_wall) * 1e-6)
            other.append((observer.seen[0] - began) * 1e3)
    late = np.array([message.log_time - message.publish_time for message in states][1000:]) * 1e-3
    lost = states[-1].sequence + 1 - len(states)
    yield 'process start to first joint_states', *_spread(own), 'ms'
    yield 'process start to first joint_states in another process that waits', *_spread(other), 'ms'
    for name, share in zip(('one remote subscriber', 'no subscriber'), shares):
        yield f'CPU share at 1 kHz, recording, {name}', *_spread([share]), '% of a core'
    yield 'state published after its tick was due, p50', np.percentile(late, 50), late.min(), late.max(), 'us'
    yield 'state published after its tick was due, p99', np.percentile(late, 99), late.min(), late.max(), 'us'
    yield 'ticks lost in the log', lost, lost, lost, f'of {len(states)}'
    share, late = bare_loop(1000.0, watched)
    yield 'a loop that only wakes up at 1 kHz: CPU share', *_spread([share]), '% of a core'
    yield 'the same: it woke up after it was due, p99', np.percentile(late, 99), late.min(), late.max(), 'us'


def _run(log: Path, observer: Observer, watched: float) -> list[float]:
    """
    Run the simulator until its first state has come; return its CPU shares in %, with the observer and then without.

    Each share is taken over `watched` s, none where that is 0.
    """
    process = subprocess.Popen(
        [sys.executable, '-m', 'planar_chain_sim.ros.node', '--ros-args', '-p', f'record:={log}'],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)
    shares, began = [], monotonic()
    try:
        while not observer.seen:
            if process.poll() is not None or monotonic() - began > WAIT:
                raise Mistake('the simulator did not start')
            sleep(1e-3)
        for prepare in (lambda: None, observer.leave) if watched else ():
            prepare()
            sleep(1.0)
            before, mark = cpu_time(process.pid), monotonic()
            sleep(watched)
            shares.append((cpu_time(process.pid) - before) / (monotonic() - mark) * 100.0)
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=WAIT)
    return shares


def bare_loop(rate: float, seconds: float) -> tuple[float, np.ndarray]:
    """
    Wake up at `rate`, Hz, as the node's tick thread does, and do nothing; return CPU share, %, and lateness (n,), us.

    No node can be cheaper or more punctual than that on this machine as busy as it is now.
    """
    late, shares = [], []

    def wake():
        wake_punctually()
        begun, spent = monotonic_ns(), thread_time()
        for k in range(1, round(rate * seconds)):
            due = begun + round(k / rate * 1e9)
            while (now := monotonic_ns()) < due:
                sleep((due - now) * 1e-9)
            late.append(now - due)
        shares.append((thread_time() - spent) / (monotonic_ns() - begun) * 1e11)

    thread = Thread(target=wake)
    thread.start()
    thread.join()
    return shares[0], np.array(late) * 1e-3


def _spread(values: list) -> tuple:
    return np.median(values), min(values), max(values)


def cpu_time(process: int) -> float:
    """User and system time of all threads of a process so far, s: proc(5), fields 14 and 15."""
    fields = Path(f'/proc/{process}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf('SC_CLK_TCK')
