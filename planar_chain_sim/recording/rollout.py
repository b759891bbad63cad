"""rollout: simulates a chain, with efforts if wanted, into an MCAP log; without ROS, as fast as the machine allows."""
from __future__ import annotations

from math import inf
from pathlib import Path
import sys
from time import perf_counter

from .effort_table import by_joint, Efforts, read_efforts
from .log_writer import COMPRESSIONS
from .offline_log import OfflineLog
from ..chain.joint_arrays import initial_state
from ..chain.section import clipped, counted
from ..chain_file import load_chain
from ..command_line import add_hold, catch_stop_signals, Parser, print_line, run_command
from ..errors import ChainError, Mistake
from ..motion.integrators import METHODS
from ..motion.simulation import Interrupted, Simulation, whole_ticks

LONGEST = 2.0**31   # s


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
                        help="new MCAP file (default: the chain file's name with .mcap, in the working directory)")
    parser.add_argument('--duration', type=float, metavar='S',
                        help='simulated time, s (default: 10, or the time that a file of efforts covers)')
    parser.add_argument('--step', type=float, default=1e-3, metavar='S', help='tick, s (default: 0.001)')
    parser.add_argument('--method', default='auto', choices=['auto', *METHODS], metavar='M',
                        help=f'{", ".join(METHODS)} (default: auto)')
    parser.add_argument('--tolerance', type=float, metavar='T', help='bound of the local error of an adaptive method '
                        '(default: 1e-9)')
    parser.add_argument('--position', metavar='P', help='initial positions, rad or m: numbers joined by commas in the '
                        'order of the joints, or joint=number for some of them; an angle also as 90deg or pi/2 '
                        "(default: the chain file's)")
    parser.add_argument('--velocity', metavar='V', help='initial velocities, rad/s or m/s, in the same way')
    parser.add_argument('--effort', metavar='E', help='joint efforts, N m or N: constant ones, as numbers joined '
                        'by commas or joint=number; or a .npy or text file with a row per tick. A text file can have '
                        'a header with the names of joints, and a column time, s, at which each row begins to act. A '
                        'joint that is not named has no effort (default: none)')
    parser.add_argument('--compression', default='none', choices=sorted(COMPRESSIONS), help='compression of the '
                        'log (default: none)')
    parser.add_argument('--record-tf', action='store_true', help="record the chain's URDF and, at most 60 times a "
                        'simulated second, the frames of its links too: Foxglove then draws the arm from the log alone')
    return parser


def _rollout_to_file(arguments) -> int:
    options = _parser().parse_args(arguments)
    chain = load_chain(options.chain, options.hold)
    simulation = _simulation(options, chain)
    effort = None if options.effort is None else read_efforts(options.effort, chain)
    ticks, effort = _ticks(options, simulation.step, effort)
    path = f'{Path(options.chain).stem}.mcap' if options.output is None else options.output
    from tqdm import tqdm  # the progress bar; not needed where rollout is a function
    print_line(f'{chain.name}: {simulation.plan}')
    began = perf_counter()
    stops = []   # signals: an exception during a record would damage the log

    def stop(number, frame) -> None:
        stops.append(number)
        simulation.interrupt()

    catch_stop_signals(stop)
    with OfflineLog(path, simulation, options.compression, options.record_tf) as log, tqdm(
            total=ticks, unit='tick', unit_scale=True, disable=None, leave=False) as bar:
        try:
            log.advance(ticks, effort, bar.update)
        except Interrupted:
            raise KeyboardInterrupt(*stops[:1]) from None
    print_line(f'{path}: {simulation.time:g} s simulated in {perf_counter() - began:.2f} s, '
               f'{counted(ticks + 1, "state")}')
    return 0


def _simulation(options, chain) -> Simulation:
    """Return the simulation of the options, at its initial state; Mistake."""
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
    duration = 10.0 if options.duration is None else options.duration
    try:
        if not LONGEST <= duration < inf:
            ticks = table.ticks(step) if table and options.duration is None else whole_ticks(duration, step)
            duration = ticks * step
    except ValueError as error:
        raise Mistake(f'--{error}') from None
    if not duration < LONGEST:
        raise Mistake(f'--duration is {duration:g} s, must be below {LONGEST:g} s, the limit of ROS time stamps')
    if table is None:
        return ticks, effort
    rows = table.by_tick(ticks, step, f'--effort {clipped(options.effort, 200)!r}')
    spare = table.ticks(step) - ticks
    if spare > 0:
        print_line(f'--effort {clipped(options.effort, 200)!r} has {counted(spare, "tick")} after the end, '
                   'which are not used')
    return ticks, rows


if __name__ == '__main__':
    sys.exit(main())
