"""Pictures of a motion: the arm at several times over one another, its joints against time; a log's joints."""
from __future__ import annotations

import sys

import numpy as np

from .chain import BASE, Chain
from .chain_yaml import load_chain
from .command_line import add_hold, Mistake, Parser, refuse_hold, run_command
from .path_matrix import motion_of_joints, path_matrix
from .simulation import rollout, Run
from .visual import body_color, COLORS, own_end

PICTURES = ('.png', '.svg')
STEP, LONGEST = 1e-3, 1e4   # s: of the motion that is drawn
INK, PAPER = '#1f2933', '#ffffff'


def body_lines(chain: Chain, position) -> list:
    """
    Return for each body its segments (start, end), complex, m: from its joint point to what it carries.

    Or as far as its `visual` says; a body that carries nothing ends as far beyond its mass centre as that lies from the
    joint point. Joint points are prefix sums, r_P = P^T (r + p) as in (5.71).
    """
    G, offset = motion_of_joints(chain)
    phi, x = np.split(G @ position + offset, [len(chain.bodies)])
    carrier = [body.carrier for body in chain.bodies]
    phi_ = np.array([phi[c] if c != BASE else 0.0 for c in carrier])
    axis = np.array([np.exp(1j * body.slide.axis) if body.slide else 0.0 for body in chain.bodies])
    steps = (np.array([body.origin for body in chain.bodies]) + x * axis) * np.exp(1j * phi_)
    points = path_matrix(chain).T @ steps
    lines = []
    carried = [[] for _ in chain.bodies]
    for k, c in enumerate(carrier):
        if c != BASE:
            carried[c].append(points[k])
    for i, body in enumerate(chain.bodies):
        own = own_end(body) or ([] if carried[i] else [2.0 * body.center_of_mass])
        ends = [points[i] + end * np.exp(1j * phi[i]) for end in own] or carried[i]
        lines.append([(points[i], end) for end in ends])
    return lines


def draw_motion(chain: Chain, run: Run, path: str, moments: int = 26, shown: float = 1.3) -> None:
    """
    Write a picture (PNG or SVG by the ending of `path`): the arm at `moments` times of its first `shown` s; its joints.

    OSError where the file cannot be written.
    """
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(11.0, 4.6), width_ratios=(1.0, 1.35), facecolor=PAPER)
    last = min(len(run.time) - 1, round(shown / (run.time[1] - run.time[0])))
    ticks = np.linspace(0, last, moments).round().astype(int)
    colors = [body_color(chain, i) for i in range(len(chain.bodies))]
    for k, tick in enumerate(ticks):
        for i, segments in enumerate(body_lines(chain, run.position[tick])):
            for start, end in segments:
                left.plot([start.real, end.real], [start.imag, end.imag], '-o', color=colors[i][:3],
                          alpha=colors[i][3] * (0.12 + 0.88 * (k / (moments - 1))**2),
                          linewidth=3.2 if tick == last else 1.6, markersize=3.0, solid_capstyle='round', zorder=k)
    left.plot([0], [0], marker='^', color=INK, markersize=9, zorder=0)
    left.set(aspect='equal', xlabel='x, m', ylabel='y, m', title=f'the first {run.time[last]:g} s')
    names = list(chain.joint_names)
    for i, body in enumerate(chain.bodies):   # a joint has the colour of its body, a slide is dashed
        for joint, style, unit in ((body.slide, '--', 'm'), (body.rotation, '-', 'rad')):
            if joint is not None:
                right.plot(run.time, run.position[:, names.index(joint.name)], style, color=colors[i][:3],
                           label=f'{joint.name}, {unit}')
    right.set(xlabel='time, s', title='joint positions', xlim=(0.0, run.time[-1]))
    right.legend(frameon=False, fontsize=8, loc='upper right')
    for axes in (left, right):
        axes.grid(alpha=0.25)
        axes.spines[['top', 'right']].set_visible(False)
    figure.tight_layout()
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


def draw_log(log, path: str) -> None:
    """
    Write a picture of a log (PNG or SVG by the ending of `path`): positions and efforts of its joints against time.

    OSError where the file cannot be written; LogError where the log cannot be read.
    """
    import matplotlib
    matplotlib.use('Agg')
    from matplotlib import pyplot

    from .recording.cdr import CdrError, decode_joint_state
    from .recording.log_error import LogError
    from .recording.run_settings import simulation_of

    chain, topic = simulation_of(log).chain, log.settings['state_topic']
    try:
        states = [decode_joint_state(message.data) for message in log.messages if message.topic == topic]
    except CdrError as error:
        raise LogError(f'log {str(log.path)!r}: a state cannot be read ({error})') from None
    if any(state.names != chain.joint_names or not len(state.position) == len(state.effort) == chain.joint_count
           for state in states):
        raise LogError(f'log {str(log.path)!r}: a state is not of the joints of its chain')
    if len(states) < 2:
        raise LogError(f'log {str(log.path)!r}: it holds {len(states)} states, must hold two to draw them')
    time = np.array([state.stamp - states[0].stamp for state in states]) * 1e-9
    figure, axes = pyplot.subplots(2, 1, figsize=(9.0, 5.4), sharex=True, facecolor=PAPER)
    for rows, quantity, units in zip(axes, ('position', 'effort'), (('m', 'rad'), ('N', 'N m'))):
        values = np.array([getattr(state, quantity) for state in states])
        for k, joint in enumerate(chain.joints):
            slide = joint.kind == 'slide'
            rows.plot(time, values[:, k], '--' if slide else '-', color=COLORS[k % len(COLORS)], linewidth=1.2,
                      label=f'{joint.name}, {units[0 if slide else 1]}')
        rows.set(title=f'joint {quantity}s', xlim=(0.0, time[-1]))
        rows.legend(frameon=False, fontsize=8, loc='upper right', ncols=2)
        rows.grid(alpha=0.25)
        rows.spines[['top', 'right']].set_visible(False)
    axes[-1].set(xlabel='time, s')
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def main(arguments=None) -> int:
    """Exit 0: drawn; 2: a mistake."""
    return run_command('pictures', _picture, arguments)


def _picture(arguments) -> int:
    program = 'python -m planar_chain_sim.pictures'
    parser = Parser(program, 'Draw how a chain moves from its initial state with no effort, or what a log holds.',
                    f'{program} config/four_link_robot.yaml docs/four_link_robot.png')
    parser.add_argument('chain', help='chain file, or an MCAP log')
    parser.add_argument('output', help='PNG or SVG file')
    add_hold(parser)
    parser.add_argument('--duration', type=float, default=12.0, metavar='S', help='simulated time, s; default 12')
    options = parser.parse_args(arguments)
    if not options.output.endswith(PICTURES):
        raise Mistake(f'{options.output!r}: must end in {" or ".join(map(repr, PICTURES))}')
    if not STEP <= options.duration <= LONGEST:
        raise Mistake(f'--duration is {options.duration:g} s, must be from {STEP:g} to {LONGEST:g} s')
    try:
        if options.chain.endswith('.mcap'):
            refuse_hold(options)
            from .recording.log_reader import read_log
            draw_log(read_log(options.chain), options.output)
        else:
            chain = load_chain(options.chain, options.hold)
            draw_motion(chain, rollout(chain, round(options.duration / STEP) * STEP, STEP), options.output)
    except OSError as error:
        if error.filename is None:   # of no file
            raise
        raise Mistake(f'{options.output!r}: {error.strerror}') from None
    except ImportError as error:
        raise Mistake(f'{error}: pictures need the extra [benchmark]') from None
    return 0


if __name__ == '__main__':
    sys.exit(main())
