"""
The node under full load for long: recording, commanded at every tick, watched from another process. Linux, ROS 2.

    python -m planar_chain_sim.benchmark.soak --rate 1000 --seconds 600

This process is the controller and the subscriber: it answers each state with efforts that differ each time, so it can
recognize the state on which they act.
"""
from __future__ import annotations

from dataclasses import dataclass, field
import os
from pathlib import Path
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from time import monotonic, sleep

import numpy as np

from .node_load import bare_loop, cpu_time
from ..command_line import Parser, run_command
from ..errors import Mistake
from ..recording.cdr import decode_joint_state, encode_float64_multi_array
from ..recording.log_reader import read_log

WAIT = 20.0      # s, after which a node that says nothing is given up
SETTLE = 1.0     # s of running that no figure counts
IDLE = 5.0       # s of a loop that does nothing, to know the machine by
STEP = 1e-9      # N m by which a command differs from the one before: nothing moves by it


@dataclass
class Watch:
    """
    Measurements of the controller: seconds from a command to the state on which it acts; resident memory over time, MB.

    cpu_share, stolen: % of a core, used by the node, and taken from all cores by the host.
    """

    latencies: list = field(default_factory=list)
    memory: list = field(default_factory=list)
    received: int = 0
    cpu_share: float = 0.0
    stolen: float = 0.0


def soak(rate: float, seconds: float, chain: str = 'seven_link_arm.yaml', record: bool = True) -> list[tuple]:
    """Run the node for `seconds` s and return rows (quantity, value, unit); Mistake where it does not start."""
    idle_share, idle_late = bare_loop(rate, IDLE)
    with TemporaryDirectory() as folder:
        log = Path(folder, 'soak.mcap')
        arguments = [sys.executable, '-m', 'planar_chain_sim.ros.node', '--ros-args', '-p', f'rate:={rate}',
                     '-p', f'chain_file:={chain}', *(['-p', f'record:={log}'] if record else [])]
        process = subprocess.Popen(arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            watch = _control(process, seconds, len_of(chain))
        finally:
            process.send_signal(signal.SIGINT)
            code = process.wait(WAIT)
        idle = [('the machine before: a loop that only wakes up', idle_share, '% of a core'),
                ('the same: it woke up late, p99', float(np.percentile(idle_late, 99)) * 1e-3, 'ms'),
                ('the machine meanwhile: taken by its host', watch.stolen, '% of a core')]
        return [*idle, *_rows(watch, rate, log if record else None, code)]


def len_of(chain: str) -> int:
    """Return the number of joints of a chain file."""
    from ..chain_file import load_chain
    return load_chain(chain).joint_count


def _control(process, seconds: float, joints: int) -> Watch:
    """Answer states for `seconds` s after the first ones."""
    try:
        import rclpy
        from rclpy.impl.implementation_singleton import rclpy_implementation
        from rclpy.node import Node
        from sensor_msgs.msg import JointState
        from std_msgs.msg import Float64MultiArray

        from ..ros.messages import PolledGroup
    except ImportError as error:
        raise Mistake(f'the node is measured with ROS 2, which cannot be loaded ({error})') from None
    context = rclpy.Context()
    rclpy.init(context=context)
    node = Node('soak', context=context)
    states = node.create_subscription(JointState, 'joint_states', lambda message: None, 100,
                                      callback_group=PolledGroup(), raw=True)
    commands = node.create_publisher(Float64MultiArray, 'simulator/commands', 10)
    try:
        begun = monotonic()
        while not commands.get_subscription_count() or not states.get_publisher_count():
            if process.poll() is not None or monotonic() - begun > WAIT:
                raise Mistake('the simulator did not start')
            sleep(1e-2)
        wait_set = rclpy_implementation.WaitSet(1, 0, 0, 0, 0, 0, context.handle)
        return _answer(process.pid, wait_set, states, commands, seconds, joints)
    finally:
        node.destroy_node()
        context.try_shutdown()


def _answer(pid: int, wait_set, states, commands, seconds: float, joints: int) -> Watch:
    watch, sent, count = Watch(), {}, 0
    effort = np.zeros(joints)
    begun = monotonic() + SETTLE
    counting, memory_due = False, 0.0
    while (now := monotonic()) < begun + seconds:
        if not counting and now >= begun:
            counting, cpu, stolen = True, cpu_time(pid), stolen_time()
        if counting and now >= memory_due:
            memory_due = now + max(seconds / 20.0, 0.1)
            watch.memory.append(resident_memory(pid))
        with states.handle:
            taken = states.handle.take_message(states.msg_type, True)
        if taken is None:   # wait: who looks again and again takes the core that the node needs
            wait_set.clear_entities()
            wait_set.add_subscription(states.handle)
            wait_set.wait(100_000_000)
            continue
        acted = float(decode_joint_state(taken[0]).effort[0])
        now = monotonic()
        if acted in sent:
            if counting:
                watch.latencies.append(now - sent[acted])
            sent.clear()   # older ones were overtaken
        count += 1
        effort[0] = count * STEP
        sent[float(effort[0])] = monotonic()
        commands.publish(bytes(encode_float64_multi_array(effort)))
        watch.received += counting
    watch.cpu_share = (cpu_time(pid) - cpu) / seconds * 100.0
    watch.stolen = (stolen_time() - stolen) / seconds * 100.0
    watch.memory.append(resident_memory(pid))
    return watch


def _rows(watch: Watch, rate: float, log, code: int):
    yield 'exit code', code, ''
    yield 'states received', watch.received, ''
    yield 'CPU share', watch.cpu_share, '% of a core'
    yield 'memory, first', watch.memory[0], 'MB'
    yield 'memory, last', watch.memory[-1], 'MB'
    latencies = np.array(watch.latencies) * rate
    for share in (50, 99):
        yield f'command to state, p{share}', float(np.percentile(latencies, share)), 'ticks'
    if log is None:
        return
    ticks, late, dropped = 0, [], 0
    last = -1
    for message in read_log(log).messages:
        if message.topic == '/joint_states':
            ticks += 1
            late.append(message.log_time - message.publish_time)
            last = message.sequence
        elif message.topic == '/simulator/events' and b'dropped_time' in message.data:
            dropped += 1
    late = np.array(late[round(SETTLE * rate):]) * 1e-6
    yield 'ticks in the log', ticks, ''
    yield 'ticks lost', last + 1 - ticks, ''
    yield 'times that time was dropped', dropped, ''
    for share in (50, 99, 99.9):
        yield f'lateness of a published state, p{share:g}', float(np.percentile(late, share)), 'ms'
    yield 'lateness, largest', float(late.max()), 'ms'


def stolen_time() -> float:
    """Time, s, that a virtual machine's processors have had to wait for the host's so far: proc(5), /proc/stat."""
    return int(Path('/proc/stat').read_text().split(maxsplit=9)[8]) / os.sysconf('SC_CLK_TCK')


def resident_memory(pid: int) -> float:
    """Resident memory of a process, MB."""
    return int(Path(f'/proc/{pid}/statm').read_text().split()[1]) * os.sysconf('SC_PAGE_SIZE') * 1e-6


def _measure(arguments) -> int:
    program = 'python -m planar_chain_sim.benchmark.soak'
    parser = Parser(program, 'Load the node for a long time and measure it.', f'{program} --seconds 600')
    parser.add_argument('--rate', type=float, nargs='+', default=[1000.0], metavar='HZ', help='ticks per second')
    parser.add_argument('--seconds', type=float, default=60.0, metavar='S', help='of each rate; default 60')
    options = parser.parse_args(arguments)
    os.environ.setdefault('ROS_AUTOMATIC_DISCOVERY_RANGE', 'LOCALHOST')
    for rate in options.rate:
        print(f'{rate:g} Hz, {options.seconds:g} s, 7 joints, recording, commanded at every tick by another process')
        for quantity, value, unit in soak(rate, options.seconds):
            print(f'  {quantity:<45} {value:>10.4g} {unit}', flush=True)
    return 0


if __name__ == '__main__':
    sys.exit(run_command('soak', _measure, None))
