"""The executable `resimulate`: a log's run again, bit for bit, or changed and compared."""
from __future__ import annotations

from functools import partial
from math import inf
from pathlib import Path
import sys
from typing import Callable, Union

from .bag_run import BagRun
from .bits import resimulate
from .changed_run import changed_simulation
from .comparison import compare, Comparison, report
from ..chain.section import clipped, counted
from ..chain_file import load_chain
from ..command_line import Parser, print_line, run_command, write_document
from ..errors import Mistake
from ..motion.integrators import METHODS
from ..motion.simulation import Simulation
from ..recording.bag import Bag, bag_files, read_bag
from ..recording.following import Following
from ..recording.log_reader import LogFile, NoLog, read_log

DESCRIPTION = """\
Run the chain of a log again, with its method, step and changes, and compare all states bit for bit.

With --method, --tolerance, --step, --chain or --set the same changes act on another run. Its positions and velocities \
are compared with those of the log, joint by joint, and the last line answers whether it matters.

A bag of the node that `ros2 bag record` made is compared in the same way. It does not tell the chain file, the method \
or the tolerance, so --chain, --method and --tolerance say what they are, and --set and --step what is changed.

Exit code 0: equal, or compared with a run that is changed; 1: different bits, or a bag whose positions differ by more \
than --threshold; 2: the file cannot be read, an option is wrong, or there is a bug."""
EXAMPLE = 'resimulate run.mcap --set forearm.mass=2 --step 0.0005 --picture deviation.png'
PICTURES = ('.png', '.svg', '.pdf')
CHANGES = ('method', 'tolerance', 'step', 'chain', 'set')


def main(arguments=None) -> int:
    """Exit 0: equal bit for bit, or compared; 1: different, first difference on stdout; 2: unreadable, a mistake."""
    return run_command('resimulate', _resimulate_file, arguments)


def _parser() -> Parser:
    parser = Parser('resimulate', DESCRIPTION, EXAMPLE)
    parser.add_argument('log', help='MCAP log of the simulator or of rollout, or a bag: its folder or file')
    parser.add_argument('--method', choices=['auto', *METHODS], metavar='M', help=f'{", ".join(METHODS)}')
    parser.add_argument('--tolerance', type=float, metavar='T', help='bound of the local error of an adaptive method')
    parser.add_argument('--step', type=float, metavar='S', help='tick, s; a change between two ticks acts at the next '
                        'one')
    parser.add_argument('--chain', metavar='CHAIN', help='another chain file; joints and bodies of the same name get '
                        'the same changes')
    parser.add_argument('--set', action='append', metavar='NAME=VALUE', help='another value of a parameter, as '
                        'forearm.mass=2 or gravity.y=-1.62; can be given several times')
    parser.add_argument('--threshold', type=float, default=1e-3, metavar='D', help='the difference of a position, rad '
                        'or m, that matters (default: 0.001)')
    parser.add_argument('--picture', metavar='FILE', help='also draw the differences over time into this new file, '
                        '.png, .svg or .pdf')
    return parser


def _resimulate_file(arguments) -> int:
    options = _parser().parse_args(arguments)
    if not 0.0 <= options.threshold < inf:
        raise Mistake(f'--threshold is {options.threshold:g}, must be a finite number >= 0')
    recorded = _recorded(Path(options.log))
    if isinstance(recorded, Bag):
        return _compare_bag(recorded, options)
    if any(getattr(options, name) is not None for name in CHANGES):
        return _compare_log(recorded, options)
    if options.picture is not None:
        raise Mistake('--picture is for a run that is changed: give --method, --tolerance, --step, --chain or --set '
                      'too')
    return _repeat(recorded)


def _recorded(path: Path) -> Union[LogFile, Bag]:
    """Return the log or the bag of a path; LogError: it is none."""
    files = bag_files(path)
    if len(files) == 1 and files[0].suffix != '.db3':
        try:
            return read_log(files[0])
        except NoLog:
            pass
    return read_bag(path)


def _repeat(log: LogFile) -> int:
    verdict = resimulate(log)
    torn = '' if log.complete else '; the log was not closed properly, only its whole chunks were compared'
    if verdict.difference is not None:
        print_line(f'different: {verdict.difference}{torn}')
        return 1
    print_line(f'equal: {counted(verdict.states, "state")} over {counted(verdict.ticks, "tick")}, bit for bit{torn}')
    return 0


def _compare_log(log: LogFile, options) -> int:
    """Compare a log with a run that is changed."""
    parameters = dict(map(_parameter, options.set or ()))
    chain = None if options.chain is None else load_chain(options.chain)

    def change(own: Simulation) -> Simulation:
        _check_tolerance(options, options.method or own.method)
        return changed_simulation(own, chain, parameters, options.method, options.step, options.tolerance)

    _compared(options, lambda: compare(log, partial(Following, log), change, options.threshold))
    return 0


def _compare_bag(bag: Bag, options) -> int:
    """Compare a bag with the run of its chain; return 1 if nothing is changed and it differs by the threshold."""
    method, parameters = options.method or 'auto', dict(map(_parameter, options.set or ()))
    chain = None if options.chain is None else load_chain(options.chain)
    _check_tolerance(options, method)
    comparison = _compared(options, lambda: compare(
        bag, partial(BagRun, bag, chain, method, options.tolerance),
        lambda own: changed_simulation(own, None, parameters, None, options.step), options.threshold))
    return 0 if comparison.what or comparison.agrees else 1


def _check_tolerance(options, method: str) -> None:
    if options.tolerance is not None and method != 'auto' and not METHODS[method].adaptive:
        raise Mistake(f'--tolerance is for adaptive methods, but method {method!r} has a fixed step')


def _compared(options, work: Callable[[], Comparison]) -> Comparison:
    """Return what is compared, drawn if asked for and reported."""
    comparison = work() if options.picture is None else _draw(options.picture, work)
    write_document(report(comparison))
    return comparison


def _draw(path: str, compared: Callable[[], Comparison]) -> Comparison:
    """Draw what is compared into a new file, which is opened first, and return it; Mistake."""
    from ..pictures.deviation import draw_deviation
    from ..pictures.figure import new_picture
    kind = Path(path).suffix.lower()
    if kind not in PICTURES:
        raise Mistake(f'--picture is {clipped(path)!r}, must end in {", ".join(PICTURES)}')
    with new_picture(path) as stream:
        comparison = compared()
        chain = comparison.run.simulation.chain
        joints = [chain.joints[chain.joint_names.index(name)] for name in comparison.joints]
        stream.write(draw_deviation(joints, *comparison.deviation.curve, comparison.deviation.threshold, kind[1:]))
    return comparison


def _parameter(text: str) -> tuple[str, float]:
    """Return name and value of NAME=VALUE; Mistake."""
    name, equals, value = text.rpartition('=')
    try:
        if equals:
            return name.strip(), float(value)
    except ValueError:
        pass
    raise Mistake(f'--set {clipped(text)!r} must be a name and a number, as forearm.mass=2')


if __name__ == '__main__':
    sys.exit(main())
