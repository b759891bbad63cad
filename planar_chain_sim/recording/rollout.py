"""rollout: a chain, and efforts if wanted, to an MCAP log; no ROS graph, as fast as the machine goes."""
from __future__ import annotations

import json
from pathlib import Path
import sys
from time import perf_counter
from typing import Optional

import numpy as np

from .cdr import encode_string, JointStateLayout
from .effort_table import by_joint, Efforts, read_efforts
from .log_writer import COMPRESSIONS, LogWriter
from .rosbag2_profile import Channel
from .run_settings import settings_of
from ..chain_file import load_chain
from ..chain_section import clipped
from ..command_line import add_hold, catch_stop_signals, Parser, run_command, tell
from ..errors import ChainError, Mistake, SimulationError
from ..integrators import METHODS
from ..simulation import initial_state, Interrupted, JointEvent, Simulation, whole_ticks

STATE_TOPIC, EVENTS_TOPIC = '/joint_states', '/simulator/events'   # what the node would publish them on
CHUNK = 1000   # ticks between two looks at the progress bar, at most
LONGEST = 2.0**31   # s
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
        for body, (force, moment, axes) in simulation.wrenches.items():   # that act already
            self._write_event(simulation.tick, 'wrench', body=body, force=[force.real, force.imag], moment=moment,
                              axes=axes)

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
    held = np.zeros(joints) if effort is None else effort
    position, velocity, acted = (np.empty((CHUNK, joints)) for _ in range(3))
    start, chunk = 0, 1
    while start < ticks:
        began, failure, first = perf_counter(), None, simulation.tick
        count = min(chunk, ticks - start)
        rows = held[start:start + count] if held.ndim == 2 else np.broadcast_to(held, (count, joints))
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


def main(arguments=None) -> int:
    """Exit 0: done; 2: a mistake, or a state that ran away (what came before it is in the log)."""
    return run_command('rollout', _rollout_to_file, arguments)


def _parser() -> Parser:
    parser = Parser('rollout', 'Simulate a chain without ROS, as fast as the machine allows, and write an MCAP log.',
                    'rollout config/four_link_robot.yaml --duration 20 --output swing.mcap')
    parser.add_argument('chain', help='chain file (YAML, URDF or MJCF); relative to the working directory, else to '
                        "the package's config")
    add_hold(parser)
    parser.add_argument('--output', metavar='LOG',
                        help="new MCAP file; default: the chain file's name with .mcap, in the working directory")
    parser.add_argument('--duration', type=float, metavar='S',
                        help='simulated time, s; default: 10, or the time that a file of efforts covers')
    parser.add_argument('--step', type=float, default=1e-3, metavar='S', help='tick, s; default 0.001')
    parser.add_argument('--method', default='auto', choices=['auto', *METHODS], metavar='M',
                        help=f'{", ".join(METHODS)}; default auto')
    parser.add_argument('--tolerance', type=float, metavar='T', help='bound of the local error of an adaptive method; '
                        'default 1e-9')
    parser.add_argument('--position', metavar='P', help='initial positions, rad or m: numbers joined by commas in the '
                        'order of the joints, or joint=number for some of them; an angle also as 90deg or pi/2; '
                        "default: the chain file's")
    parser.add_argument('--velocity', metavar='V', help='initial velocities, rad/s or m/s, in the same way')
    parser.add_argument('--effort', metavar='E', help='joint efforts, N m or N: constant ones, as numbers joined '
                        'by commas or joint=number; or a .npy or text file with a row per tick. A text file can have '
                        'a header with the names of joints, and a column time, s, at which each row begins to act. A '
                        'joint that is not named has no effort. Default: none')
    parser.add_argument('--compression', default='none', choices=sorted(COMPRESSIONS), help='compression of the '
                        'log; default none')
    return parser


def _rollout_to_file(arguments) -> int:
    options = _parser().parse_args(arguments)
    chain = load_chain(options.chain, options.hold)
    simulation = _simulation(options, chain)
    effort = None if options.effort is None else read_efforts(options.effort, chain)
    ticks, effort = _ticks(options, simulation.step, effort)
    path = options.output or f'{Path(options.chain).stem}.mcap'
    from tqdm import tqdm   # the progress bar; not needed where rollout is a function
    tell(f'{chain.name}: {simulation.plan}')
    began = perf_counter()
    stops = []   # signals: an exception in the midst of a record would tear the log
    catch_stop_signals(lambda number, frame: (stops.append(number), simulation.interrupt()))
    with OfflineLog(path, simulation, options.compression) as log, tqdm(
            total=ticks, unit='tick', unit_scale=True, disable=None, leave=False) as bar:
        try:
            roll_to_log(simulation, ticks, effort, log, bar.update)
        except Interrupted:
            raise KeyboardInterrupt(*stops[:1]) from None
    tell(f'{path}: {simulation.time:g} s simulated in {perf_counter() - began:.2f} s, {ticks + 1} states')
    return 0


def _simulation(options, chain) -> Simulation:
    """Return the simulation that the options ask for, at its initial state; Mistake."""
    if options.tolerance is not None and options.method != 'auto' and not METHODS[options.method].adaptive:
        raise Mistake(f'--tolerance is for adaptive methods, but method {options.method!r} has a fixed step')
    try:
        simulation = Simulation(chain, options.method, options.step, options.tolerance)
    except ChainError:
        raise
    except ValueError as error:   # of step or tolerance
        raise Mistake(f'--{error}') from None
    state = list(initial_state(chain))
    for k, (quantity, units) in enumerate({'position': ('m', 'rad'), 'velocity': ('m/s', 'rad/s')}.items()):
        text = getattr(options, quantity)
        if text is not None:
            name = f'--{quantity} {clipped(text, 200)!r}'
            values = by_joint(text, name, chain, state[k], units, angles=True)
            if values is None:
                raise Mistake(f'{name} is not a list of numbers, must be {chain.joint_count} joined by commas, or '
                              f'joint=number for some of {clipped(", ".join(chain.joint_names), 200)}')
            state[k] = values
    try:
        simulation.set_state(*state)
    except ValueError as error:   # a position beyond a stop
        raise Mistake(f'--{error}') from None
    return simulation


def _ticks(options, step: float, effort) -> tuple:
    """Return the number of ticks, and efforts as roll_to_log takes them; Mistake."""
    table = effort if isinstance(effort, Efforts) else None
    try:
        ticks = table.ticks(step) if table and options.duration is None else whole_ticks(
            10.0 if options.duration is None else options.duration, step)
    except ValueError as error:
        raise Mistake(f'--{error}') from None
    if not ticks * step < LONGEST:
        raise Mistake(f'--duration is {ticks * step:g} s, must be below {LONGEST:g} s, the limit of ROS time stamps')
    if table is None:
        return ticks, effort
    rows = table.by_tick(ticks, step, f'--effort {clipped(options.effort, 200)!r}')
    spare = table.ticks(step) - ticks
    if spare > 0:
        tell(f'--effort {clipped(options.effort, 200)!r} has {spare} ticks after the end, which are not used')
    return ticks, rows


if __name__ == '__main__':
    sys.exit(main())
