"""The executable `plot`: joints, energy, events and paths of logs against time, over one another: PNG, SVG or PDF."""
from __future__ import annotations

from dataclasses import replace
from pathlib import Path
import sys
from warnings import warn

import numpy as np

from .figure import new_picture
from .panels import draw, WHAT
from .source import add_trace, ALONE, is_log, no_motion, read_trace, SOURCE, Source, source_of_chain, source_of_log
from ..chain.section import clipped, suggestion
from ..command_line import add_hold, Parser, print_line, refuse_existing, refuse_hold, run_command
from ..errors import Mistake
from ..recording.seekable_log import SeekableLog

KINDS = ('.png', '.svg', '.pdf')
STEP, LONGEST = 1e-3, 1e3    # s: of a chain file
MOST = 4                     # sources: as many kinds of lines as can be told apart


def main(arguments=None) -> int:
    """Exit 0: drawn; 2: a mistake."""
    return run_command('plot', _plot, arguments)


def _parser() -> Parser:
    parser = Parser('plot', 'Draw what logs hold, or how chains move from their initial state with no effort, against '
                    'time. Several files are drawn over one another.', 'plot swing.mcap --what position,energy --to 5')
    parser.add_argument('source', nargs='+', metavar='LOG|CHAIN', help=f'{SOURCE}; at most {MOST}')
    parser.add_argument('--output', metavar='FILE', help=f'new file, {", ".join(KINDS)} (default: the name of the '
                        'first source with .png, in the working directory)')
    parser.add_argument('--what', metavar='LIST', help=f'what is drawn, joined by commas: {", ".join(WHAT)}; arm is '
                        'the arm at several moments (default: all that there is, but arm)')
    parser.add_argument('--joints', metavar='LIST', help='names of the joints that are drawn, joined by commas '
                        '(default: all)')
    parser.add_argument('--from', type=float, dest='start', metavar='S', help='simulated time at which the picture '
                        'begins, s (default: the first of the file)')
    parser.add_argument('--to', type=float, dest='end', metavar='S', help='simulated time at which the picture '
                        f'ends, s (default: the last of a log, {ALONE:g} of a chain)')
    add_trace(parser)
    add_hold(parser)
    return parser


def _plot(arguments) -> int:
    options = _parser().parse_args(arguments)
    path = f'{Path(options.source[0]).stem}.png' if options.output is None else options.output
    kind = Path(path).suffix.lower()
    if kind not in KINDS:
        raise Mistake(f'--output is {clipped(path)!r}, must end in {", ".join(KINDS)}')
    if len(options.source) > MOST:
        raise Mistake(f'{len(options.source)} files are given, at most {MOST} can be told apart in one picture')
    what = _listed(options.what, '--what', list(WHAT))
    for name, value in (('--from', options.start), ('--to', options.end)):
        if value is not None and not np.isfinite(value):
            raise Mistake(f'{name} is {value:g}, must be a number of seconds')
    if None not in (options.start, options.end) and not options.start < options.end:
        raise Mistake(f'--from is {options.start:g} s, must be below --to, {options.end:g} s')
    if all(map(is_log, options.source)):
        refuse_hold(options)
    refuse_existing(path)
    sources = [_part(each, options) for each in options.source]
    if len({each.name for each in sources}) < len(sources):
        sources = [replace(each, name=clipped(given)) for each, given in zip(sources, options.source)]
    names = list(dict.fromkeys(name for each in sources for name in each.chain.joint_names))
    joints = _listed(options.joints, '--joints', names) or names
    traces = [read_trace(options.trace, each.chain) for each in sources]
    _say_what_is_not_compared(sources, joints)
    with new_picture(path) as stream:
        stream.write(draw(sources, traces, what or _all_there_is(sources), joints, kind[1:]))
    for each in sources:
        each.say_what_is_missing(options.start, options.end)
    print_line(f'{path}: {Path(path).stat().st_size / 1000:.0f} kB')
    return 0


def _listed(text, option: str, known: list) -> list:
    """Return the names in an option's text, [] without it; Mistake: one is not known."""
    if text is None:
        return []
    names = [name.strip() for name in text.split(',')]
    for name in names:
        if name not in known:
            raise Mistake(f'{option}: there is no {clipped(name)!r}{suggestion(name, known)}, must be among '
                          f'{clipped(", ".join(known), 200)}')
    return list(dict.fromkeys(names))


def _all_there_is(sources: list) -> list:
    """Return what is drawn without --what: efforts and events only where there are some."""
    has = {'effort': any(each.effort.any() for each in sources), 'events': any(each.events for each in sources),
           'arm': False}
    return [name for name in WHAT if has.get(name, True)]


def _part(path: str, options) -> Source:
    """Return the part of a source from --from to --to; Mistake, ChainError, LogError."""
    if is_log(path):
        with SeekableLog(path) as log:
            source = source_of_log(log, *(bound if each is None else each for each, bound in (
                (options.start, -np.inf), (options.end, np.inf))))
            held = log.first_time, log.last_time
    else:
        end = ALONE if options.end is None else options.end
        if not STEP <= end <= LONGEST:
            raise Mistake(f'--to is {end:g} s, must be from {STEP:g} to {LONGEST:g} for a chain file')
        source = source_of_chain(path, options.hold, round(end / STEP), STEP)
        held = source.time[0], source.time[-1]
    part = source.part(options.start, options.end)
    if len(part.time) < 2:
        raise no_motion(path, *held)
    return part


def _say_what_is_not_compared(sources: list, joints: list) -> None:
    """Warn in one sentence of joints that not all chains have, or that slide in one and turn in another."""
    kinds = [{joint.name: joint.kind for joint in each.chain.joints} for each in sources]
    alone = [name for name in joints if not all(name in each for each in kinds)]
    other = [name for name in joints if name not in alone and len({each[name] for each in kinds}) > 1]
    said = [f'{clipped(", ".join(names[:3]), 200)}{f" and {len(names) - 3} more" if len(names) > 3 else ""} {why}'
            for names, why in ((alone, 'cannot be compared, as not all files have such a joint'),
                               (other, 'cannot be compared, as it slides in one file and turns in another')) if names]
    if said:
        warn('; '.join(said), stacklevel=2)


if __name__ == '__main__':
    sys.exit(main())
