"""The executable `animate`: a moving picture of a chain, or of the run in a log, to scale, as a GIF."""
from __future__ import annotations

from io import BytesIO
from pathlib import Path
import sys

import numpy as np

from .figure import figure, INK
from ..chain.chain import Chain
from ..chain.section import clipped
from ..chain.visual import body_color
from ..chain_file import load_chain
from ..command_line import add_hold, Parser, PICTURES_NEED, print_line, refuse_existing, refuse_hold, run_command
from ..errors import Mistake
from ..mechanics.body_lines import body_lines
from ..motion.rollout import rollout

FRAME = 0.04              # s between two frames, 25 a second; GIF counts in 10 ms
PART = 4                  # positions for each frame, so that trails are smooth
TRAIL = 1.0               # s of the picture's own time that a trail is long
MOST_FRAMES = 3000        # two minutes
MOST_BYTES = 3e8          # of all frames, which are in memory together: 1302 of 480 x 480 pixels
SIZES = (120, 2000)       # px
DPI = 100
COLORS = 64               # of the picture
SHORTEST, FASTEST = 1e-6, 1e6


def draw_animation(chain: Chain, position: np.ndarray, speed: float, size: int = 480) -> bytes:
    """
    Return a GIF of a motion: the bodies to scale, the trails of the ends of the chain, the simulated time.

    `position` (PART * frames + 1, joints), in steps of speed * FRAME / PART s; `speed`: simulated seconds per second;
    `size`: of the wider side, px. ValueError: bad shape, non-finite value. ImportError without matplotlib and pillow.
    """
    from matplotlib import pyplot
    from PIL import Image
    scene = _Scene(chain, [body_lines(chain, row) for row in position], speed, size)
    try:
        samples = [scene.pixels(row) for row in np.linspace(0, len(position) - 1, 8).round().astype(int)]
        palette = Image.fromarray(np.vstack(samples)).quantize(COLORS - 1)
        colors = palette.getpalette() or []
        palette.putpalette([255, 255, 255, *colors[:3 * COLORS - 3]])     # paper that is white
        frames = [Image.fromarray(scene.pixels(row)).quantize(palette=palette, dither=Image.Dither.NONE)
                  for row in range(0, len(position), PART)]
    finally:
        pyplot.close(scene.drawn)
    file = BytesIO()
    frames[0].save(file, 'GIF', save_all=True, append_images=frames[1:], duration=round(1000 * FRAME), loop=0)
    return file.getvalue()


class _Scene:
    """A figure with axes to scale that hold a whole motion: what stands still is drawn once, the rest for each row."""

    def __init__(self, chain: Chain, lines: list, speed: float, size: int):
        self._lines, self._step = lines, speed * FRAME / PART
        carriers = {body.carrier for body in chain.bodies}
        ends = [k for k in range(len(chain.bodies)) if k not in carriers]
        self._trails = np.array([[places[k][-1][1] for k in ends] for places in lines])
        self.drawn, axes = self._empty(size)
        colors = [body_color(chain, k) for k in range(len(chain.bodies))]
        self._tails = [axes.plot([], [], color=colors[k], linewidth=1.2, alpha=0.5, animated=True)[0] for k in ends]
        self._bodies = [[axes.plot([], [], '-o', color=color, linewidth=3.4, markersize=4.5, solid_capstyle='round',
                                   animated=True)[0] for _ in places] for color, places in zip(colors, lines[0])]
        self._time = axes.text(0.02, 0.98, '', transform=axes.transAxes, va='top', color=INK, animated=True)
        self._axes = axes
        self.drawn.canvas.draw()
        self._still = self.drawn.canvas.copy_from_bbox(self.drawn.bbox)

    def _empty(self, size: int):
        """Return a figure and axes that hold every point of the motion, with the base, a grid and its width."""
        points = np.array([point for row in self._lines for places in row for line in places for point in line] + [0j])
        low, high = (np.array([pick(points.real), pick(points.imag)]) for pick in (np.min, np.max))
        margin = 0.06 * max(*(high - low), 1e-9)
        low, high = low - margin, high + margin
        inches = np.maximum((high - low) * size / DPI / max(high - low), SIZES[0] / DPI)
        from matplotlib.ticker import MultipleLocator
        drawn, axes = figure(1, 1, tuple(inches), dpi=DPI)
        axes.set(aspect='equal', xlim=(low[0], high[0]), ylim=(low[1], high[1]), position=(0.0, 0.0, 1.0, 1.0))
        ticks = axes.get_xticks() if inches[0] > inches[1] else axes.get_yticks()
        for axis in (axes.xaxis, axes.yaxis):
            axis.set_major_locator(MultipleLocator(ticks[1] - ticks[0]))
        axes.grid(alpha=0.25)
        axes.spines[:].set_visible(False)
        axes.tick_params(length=0, labelcolor=(0.0, 0.0, 0.0, 0.0))
        axes.plot([0.0], [0.0], marker='^', color=INK, markersize=9, zorder=0)
        axes.text(0.98, 0.98, f'grid {ticks[1] - ticks[0]:g} m', transform=axes.transAxes, ha='right', va='top',
                  color=INK)
        return drawn, axes

    def pixels(self, row: int) -> np.ndarray:
        """Return the picture at a row of the positions, (height, width, 3) bytes."""
        canvas = self.drawn.canvas
        canvas.restore_region(self._still)
        first = max(0, row - round(TRAIL / FRAME) * PART)
        for tail, way in zip(self._tails, self._trails.T):
            tail.set_data(way[first:row + 1].real, way[first:row + 1].imag)
        for segments, places in zip(self._bodies, self._lines[row]):
            for segment, (start, end) in zip(segments, places):
                segment.set_data([start.real, end.real], [start.imag, end.imag])
        self._time.set_text(f't = {row * self._step:.2f} s')
        for artist in (*self._tails, *(segment for segments in self._bodies for segment in segments), self._time):
            self._axes.draw_artist(artist)
        return np.asarray(canvas.buffer_rgba())[..., :3].copy()


def main(arguments=None) -> int:
    """Exit 0: drawn; 2: a mistake."""
    return run_command('animate', _animate, arguments)


def _parser() -> Parser:
    parser = Parser('animate', 'Draw a moving picture of a chain that moves from its initial state with no effort, or '
                    'of the run in a log: to scale, with the trails of its ends.',
                    'animate four_link_robot.yaml --output arm.gif')
    parser.add_argument('source', metavar='CHAIN|LOG', help='chain file (YAML, URDF or MJCF), or an MCAP log')
    parser.add_argument('--output', metavar='FILE', help='GIF file to write, a new one; default: the name of the chain '
                        'file or log with .gif, in the working directory')
    add_hold(parser)
    parser.add_argument('--duration', type=float, metavar='S',
                        help='simulated time that is shown, s (default: 8, of a log all)')
    parser.add_argument('--speed', type=float, default=1.0, metavar='F',
                        help='simulated seconds per second (default: 1)')
    parser.add_argument('--size', type=int, default=480, metavar='PX', help='wider side, pixels (default: 480)')
    return parser


def _animate(arguments) -> int:
    options = _parser().parse_args(arguments)
    path = options.output or f'{Path(options.source).stem}.gif'
    if not path.lower().endswith('.gif'):
        raise Mistake(f"--output is {clipped(path)!r}, must end in '.gif'")
    if not SIZES[0] <= options.size <= SIZES[1]:
        raise Mistake(f'--size is {options.size} px, must be from {SIZES[0]} to {SIZES[1]}')
    if not SHORTEST <= options.speed <= FASTEST:
        raise Mistake(f'--speed is {options.speed:g}, must be from {SHORTEST:g} to {FASTEST:g}')
    if options.duration is not None and not 0.0 < options.duration < np.inf:
        raise Mistake(f'--duration is {options.duration:g} s, must be a positive number of seconds')
    refuse_existing(path)
    try:
        picture = draw_animation(*_motion(options), options.speed, options.size)
    except ImportError as error:
        if (error.name or '').partition('.')[0] not in ('matplotlib', 'PIL'):
            raise
        raise Mistake(f'{error}: {PICTURES_NEED}') from None
    try:
        with open(path, 'xb') as stream:
            stream.write(picture)
    except (OSError, ValueError) as error:   # ValueError: a NUL in the name
        raise Mistake(f'{path!r}: {getattr(error, "strerror", None) or error}') from None
    print_line(f'{path}: {len(picture) / 1000:.0f} kB')
    return 0


def _motion(options) -> tuple[Chain, np.ndarray]:
    """Return the chain and its positions as draw_animation takes them; Mistake, ChainError, LogError."""
    step = options.speed * FRAME / PART
    if not options.source.endswith('.mcap'):
        chain = load_chain(options.source, options.hold)
        ticks = _frames(options.duration or 8.0, options) * PART
        return chain, rollout(chain, ticks * step, step).position
    refuse_hold(options)
    from ..recording.log import load_log
    log = load_log(options.source)
    if len(log.time) < 2:
        raise Mistake(f'log {clipped(options.source)!r} holds {len(log.time)} states, must hold two to move')
    long = log.time[-1] - log.time[0]
    ticks = _frames(min(options.duration or long, long), options) * PART
    times = log.time[0] + step * np.arange(ticks + 1)
    return log.chain, np.array([np.interp(times, log.time, joint) for joint in log.position.T]).T


def _frames(duration: float, options) -> int:
    """Return the number of frames after the first one; Mistake: none or too many."""
    frames = min(duration / options.speed / FRAME, 1e9)
    most = min(MOST_FRAMES, int(MOST_BYTES / options.size**2))
    if not 1.0 <= frames <= most:
        raise Mistake(f'{duration:g} s at the speed {options.speed:g} are {frames:.3g} frames, must be from 1 to '
                      f'{most} of this size, {1 / FRAME:.0f} a second: give another --duration, --speed or --size')
    return round(frames)


if __name__ == '__main__':
    sys.exit(main())
