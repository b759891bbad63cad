"""rollout: a chain, and efforts if wanted, to an MCAP log; no ROS graph, as fast as the machine goes."""
from __future__ import annotations

import json
from pathlib import Path
import signal
import sys
from time import perf_counter
from typing import Optional

import numpy as np

from .cdr import encode_string, JointStateLayout
from .log_writer import COMPRESSIONS, LogWriter
from .rosbag2_profile import Channel
from .run_settings import settings_of
from ..chain import Chain
from ..chain_yaml import load_chain
from ..command_line import Mistake, Parser, run_command
from ..dynamics import Interrupted, joint_array, SimulationError
from ..integrators import METHODS
from ..simulation import JointEvent, Simulation, whole_ticks

STATE_TOPIC, EVENTS_TOPIC = '/joint_states', '/simulator/events'   # what the node would publish them on
CHUNK = 1000   # ticks between two looks at the progress bar, at most
LONG = 0.1     # s of wall time, beyond which fewer ticks are made between two looks


class OfflineLog:
    """The log of a rollout: one state per tick, one event per change of effort; log time is simulated time."""

    def __init__(self, path, simulation: Simulation, compression: str = 'none'):
        self._step, self._held = simulation.step, np.zeros(simulation.chain.joint_count)
        self._layout = JointStateLayout(simulation.chain.joint_names)
        channels = [Channel(STATE_TOPIC, 'sensor_msgs/msg/JointState'), Channel(EVENTS_TOPIC, 'std_msgs/msg/String')]
        self._writer = LogWriter(path, channels, {'chain.yaml': simulation.chain.source.encode()},
                                 {'planar_chain_sim': settings_of(simulation, STATE_TOPIC, EVENTS_TOPIC)},
                                 compression=compression)
        self.write_state(simulation.tick, simulation.position, simulation.velocity, simulation.effort)

    def __enter__(self):
        return self

    def __exit__(self, *exception):
        self._writer.close()

    def write_state(self, tick: int, position, velocity, effort) -> None:
        """Append the state (joints,) of a tick with the effort that acted over the tick before it."""
        layout = self._layout
        layout.position[:], layout.velocity[:], layout.effort[:] = position, velocity, effort
        time = self._nanoseconds(tick)
        self._writer.write(STATE_TOPIC, layout.stamped(time), time, time, tick)

    def write_command(self, tick: int, effort) -> None:
        """Append the event of a commanded effort (joints,) that acts from this tick on, if it differs from the last."""
        if effort.tobytes() != self._held.tobytes():
            self._held = effort.copy()
            self._write_event(tick, 'command', effort=effort.tolist())

    def write_joint_event(self, event: JointEvent) -> None:
        """Append a stop touched or left, a joint stuck or slipped, at its time between two ticks."""
        self._write_event(event.tick, event.kind, at=event.time, joint=event.joint, time=event.time, speed=event.speed)

    def write_end(self, error: SimulationError) -> None:
        """Append the event that ended the run: a divergence where the state ran away, else why it stopped."""
        self._write_event(error.tick, 'divergence' if error.ran_away else 'stopped', message=str(error),
                          reason=error.reason, joint=error.joint, body=error.body, time=error.time)

    def _write_event(self, tick: int, kind: str, at: Optional[float] = None, **data) -> None:
        time = self._nanoseconds(tick) if at is None else round(at * 1e9)
        event = encode_string(json.dumps({'tick': tick, 'kind': kind, 'data': data}))
        self._writer.write(EVENTS_TOPIC, event, time, time)

    def _nanoseconds(self, tick: int) -> int:
        return round(tick * self._step * 1e9)


def roll_to_log(simulation: Simulation, ticks: int, effort: Optional[np.ndarray], log: OfflineLog,
                show=lambda ticks: None) -> None:
    """
    Advance `ticks` ticks under `effort`, (joints,) held or (ticks, joints), into the log; `show(n)` after n more ticks.

    SimulationError and Interrupted as Simulation.advance, after the ticks before it have been logged.
    """
    joints = simulation.chain.joint_count
    efforts = np.broadcast_to(np.zeros(joints) if effort is None else effort, (ticks, joints))
    position, velocity, acted = (np.empty((CHUNK, joints)) for _ in range(3))
    start, chunk = 0, 1
    while start < ticks:
        began, rows, failure, first = perf_counter(), efforts[start:start + chunk], None, simulation.tick
        count = len(rows)
        try:
            simulation.advance(count, rows, record=(position[:count], velocity[:count], acted[:count]))
        except (SimulationError, Interrupted) as error:
            failure = error
        events = simulation.take_events()
        for k in range(simulation.tick - first):
            log.write_command(first + k, rows[k])
            while events and events[0].tick <= first + k:
                log.write_joint_event(events.pop(0))
            log.write_state(first + k + 1, position[k], velocity[k], acted[k])
        show(simulation.tick - first)
        if isinstance(failure, SimulationError):
            log.write_end(failure)
        if failure:
            raise failure
        start, quick = start + count, perf_counter() - began < LONG
        chunk = min(CHUNK, 2 * chunk) if quick else max(1, chunk // 2)


def read_efforts(text: str, chain: Chain) -> np.ndarray:
    """Efforts from '1,0,-2' (one held row) or a .npy or .csv file (a row per tick); Mistake says what is wrong."""
    joints = chain.joint_count
    path = Path(text)
    try:
        if path.suffix == '.npy':
            values = np.load(path, allow_pickle=False)
        elif path.suffix == '.csv':
            values = np.loadtxt(path, delimiter=',', ndmin=2)
        else:
            values = np.array([float(value) for value in text.split(',')])
    except (OSError, ValueError, EOFError) as error:
        reason = getattr(error, 'strerror', None) or str(error).splitlines()[0]
        raise Mistake(f'--effort {text!r}: {reason}, must be {joints} numbers joined by commas, or a .csv or .npy file '
                      'with a row per tick') from None
    shape = (joints,) if values.ndim == 1 else (len(values) if values.ndim else 1, joints)
    try:
        return joint_array(f'--effort {text!r}', values, shape)
    except ValueError as error:
        raise Mistake(str(error)) from None


def main(arguments=None) -> int:
    """Exit 0: done; 2: a mistake, or a state that ran away (what came before it is in the log)."""
    return run_command('rollout', _rollout_to_file, arguments)


def _parser() -> Parser:
    parser = Parser('rollout', 'Simulate a chain with no ROS graph, as fast as the machine goes, into an MCAP log.',
                    'rollout config/four_link_robot.yaml --duration 20 --output swing.mcap')
    parser.add_argument('chain', help="chain file; relative to the working directory, else to the package's config")
    parser.add_argument('--output', metavar='LOG',
                        help="new MCAP file; default: the chain file's name with .mcap, here")
    parser.add_argument('--duration', type=float, metavar='S',
                        help='simulated time, s; default: 10, or what a file of efforts covers')
    parser.add_argument('--step', type=float, default=1e-3, metavar='S', help='tick, s; default 0.001')
    parser.add_argument('--method', default='auto', choices=['auto', *METHODS], help='default auto')
    parser.add_argument('--tolerance', type=float, metavar='T', help='bound of the local error of an adaptive method; '
                        'default 1e-9')
    parser.add_argument('--effort', metavar='E', help='joint efforts, N m or N: numbers joined by commas, held; or a '
                        '.csv or .npy file with a row per tick; default: none')
    parser.add_argument('--compression', default='none', choices=sorted(COMPRESSIONS), help='of the log; default none')
    return parser


def _rollout_to_file(arguments) -> int:
    options = _parser().parse_args(arguments)
    chain = load_chain(options.chain)
    simulation = Simulation(chain, options.method, options.step, options.tolerance)
    effort = None if options.effort is None else read_efforts(options.effort, chain)
    rows = len(effort) if effort is not None and effort.ndim == 2 else None
    ticks = rows if rows is not None and options.duration is None else whole_ticks(
        10.0 if options.duration is None else options.duration, simulation.step)
    if rows not in (None, ticks):
        raise Mistake(f'--effort {options.effort!r} has {rows} rows, must have one for each of the {ticks} ticks')
    path = options.output or f'{Path(options.chain).stem}.mcap'
    from tqdm import tqdm   # the progress bar; not needed where rollout is a function
    print(f'{chain.name}: {simulation.plan}')
    began = perf_counter()
    for number in (signal.SIGINT, signal.SIGTERM):   # an exception in the midst of a record would tear the log
        signal.signal(number, lambda number, frame: simulation.interrupt())
    with OfflineLog(path, simulation, options.compression) as log, tqdm(
            total=ticks, unit='tick', unit_scale=True, disable=None, leave=False) as bar:
        try:
            roll_to_log(simulation, ticks, effort, log, bar.update)
        except Interrupted:
            raise KeyboardInterrupt from None
    print(f'{path}: {simulation.time:g} s simulated in {perf_counter() - began:.2f} s, {ticks + 1} states')
    return 0


if __name__ == '__main__':
    sys.exit(main())
