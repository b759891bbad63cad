"""The executable `animate`: a moving picture of a chain, or of the run in a log, to scale: GIF, MP4, SVG or HTML."""
from __future__ import annotations

from pathlib import Path
import sys

import numpy as np

from .energies import stretches
from .figure import new_picture
from .raster import GIF_EVERY, MP4_EVERY, write_gif, write_mp4
from .scene import Force, LEAST, Look, SAMPLE, Scene
from .source import add_trace, ALONE, is_log, read_trace, SOURCE, Source, source_of_chain, source_of_log
from .vector import EVERY, write_html, write_svg
from ..chain.section import clipped
from ..command_line import add_hold, Parser, print_line, refuse_existing, refuse_hold, run_command
from ..errors import Mistake
from ..recording.seekable_log import SeekableLog

# By the ending of the file: rows of positions from frame to frame, and how many frames there may be of one pixel (a GIF
# is in memory as a whole) or of one body (whose motion is in memory; of the last two, in the file).
KINDS = {'.gif': (GIF_EVERY, 3e8), '.mp4': (MP4_EVERY, 1e6), '.svg': (EVERY, 1e5), '.html': (EVERY, 1e5)}
LARGEST = 4000       # px
SHORTEST, FASTEST = 1e-6, 1e6
LONGEST_TRAIL = 1e6   # s
MOST_FRAMES, MOST_ROWS = 200_000, 2_000_000


def main(arguments=None) -> int:
    """Exit 0: drawn; 2: a mistake."""
    return run_command('animate', _animate, arguments)


def _parser() -> Parser:
    parser = Parser('animate', 'Draw a moving picture of a chain that moves from its initial state with no effort, or '
                    'of the run in a log, to scale.', 'animate four_link_robot.yaml --output arm.mp4')
    parser.add_argument('source', metavar='CHAIN|LOG', help=SOURCE)
    parser.add_argument('--output', metavar='FILE', help='new file: .gif, .mp4, .svg, which moves by itself in a '
                        'browser, or .html, a page with buttons (default: the name of the chain file or log with .gif, '
                        'in the working directory)')
    add_hold(parser)
    parser.add_argument('--from', type=float, default=0.0, metavar='S', dest='start',
                        help='simulated time at which the picture begins, s, counted from the beginning (default: 0)')
    parser.add_argument('--duration', type=float, metavar='S',
                        help=f'simulated time that is shown, s (default: {ALONE:g}, of a log all)')
    parser.add_argument('--speed', type=float, default=1.0, metavar='F',
                        help='simulated seconds per second (default: 1)')
    parser.add_argument('--size', type=int, default=480, metavar='PX', help='wider side, pixels (default: 480)')
    parser.add_argument('--trail', type=float, default=1.0, metavar='S',
                        help="length of the trails, s of the picture's own time, 0 for none (default: 1)")
    add_trace(parser)
    return parser


def _animate(arguments) -> int:
    options = _parser().parse_args(arguments)
    path = f'{Path(options.source).stem}.gif' if options.output is None else options.output
    kind = Path(path).suffix.lower()
    if kind not in KINDS:
        raise Mistake(f'--output is {clipped(path)!r}, must end in {", ".join(KINDS)}')
    if not LEAST <= options.size <= LARGEST:
        raise Mistake(f'--size is {options.size} px, must be from {LEAST} to {LARGEST}')
    if not SHORTEST <= options.speed <= FASTEST:
        raise Mistake(f'--speed is {options.speed:g}, must be from {SHORTEST:g} to {FASTEST:g}')
    if options.duration is not None and not 0.0 < options.duration < np.inf:
        raise Mistake(f'--duration is {options.duration:g} s, must be a positive number of seconds')
    if not 0.0 <= options.start < np.inf:
        raise Mistake(f'--from is {options.start:g} s, must be a number of seconds that is not negative')
    if not 0.0 <= options.trail <= LONGEST_TRAIL:
        raise Mistake(f'--trail is {options.trail:g} s, must be from 0 to {LONGEST_TRAIL:g}')
    refuse_existing(path)
    source, position, look = _motion(options, kind)
    from tqdm import tqdm
    with new_picture(path) as stream, tqdm(total=(len(position) - 1) // KINDS[kind][0] + 1, unit='frame', disable=None,
                                           leave=False) as bar:
        scene = Scene(source.chain, position, look)
        if kind == '.mp4':
            write_mp4(scene, path, bar.update)
        else:
            {'.gif': write_gif, '.svg': write_svg, '.html': write_html}[kind](scene, stream, bar.update)
    if options.duration is not None:
        source.say_what_is_missing(None, look.start + options.duration)
    print_line(f'{path}: {Path(path).stat().st_size / 1000:.0f} kB')
    return 0


def _motion(options, kind: str) -> tuple[Source, np.ndarray, Look]:
    """Return what is drawn, its positions as Scene takes them, and how it is shown; Mistake, ChainError, LogError."""
    step = options.speed * SAMPLE
    if is_log(options.source):
        refuse_hold(options)
        with SeekableLog(options.source) as log:
            length, start = log.last_time - log.first_time, log.first_time + options.start
            if not options.start < length:
                raise Mistake(f'--from is {options.start:g} s, but the log is {length:g} s long')
            length -= options.start
            rows = _rows(min(options.duration or length, length), options, kind, len(log.chain.bodies))
            source = source_of_log(log, start, start + rows * step)
    else:
        rows = _rows(options.duration or ALONE, options, kind, 1)
        before = round(min(options.start / step, 1e9))
        if before > MOST_ROWS:
            raise Mistake(f'--from is {options.start:g} s, must be at most {MOST_ROWS * step:g} s at this speed')
        source, start = source_of_chain(options.source, options.hold, before + rows, step), options.start
        rows = _rows(rows * step, options, kind, len(source.chain.bodies))
    times = start + step * np.arange(rows + 1)
    position = np.array([np.interp(times, source.time, joint) for joint in source.position.T]).T
    return source, position, Look(options.speed, options.size, options.trail, read_trace(options.trace, source.chain),
                                  start, _forces(source, start, step, rows))


def _rows(duration: float, options, kind: str, bodies: int) -> int:
    """Return the number of rows of positions after the first one; Mistake: no frame, or too many."""
    every, room = KINDS[kind]
    frame = every * SAMPLE
    frames = min(duration / options.speed / frame, 1e9)
    most = int(min(MOST_FRAMES, room / (options.size**2 if kind == '.gif' else bodies)))
    if not 1.0 <= frames + 1e-9 <= most:
        raise Mistake(f'{duration:g} s at the speed {options.speed:g} are {frames:.3g} frames, must be from 1 to '
                      f'{most} of this kind and size, {1 / frame:g} a second: give another --duration, --speed or '
                      '--size')
    return round(frames) * every


def _forces(source: Source, start: float, step: float, rows: int) -> list:
    """Return the forces from outside, by rows of the picture."""
    forces = []
    for part in stretches(source):
        first, last = (int(np.ceil((time - start) / step - 1e-9)) for time in source.time[[part.first, part.last]])
        if part.wrenches and max(first, 0) < last:
            forces += [Force(source.chain.body_index[body], max(first, 0), min(last - 1, rows), wrench.force,
                             wrench.axes == 'body') for body, wrench in part.wrenches.items()
                       if body in source.chain.body_index]   # else a payload
    return forces


if __name__ == '__main__':
    sys.exit(main())
