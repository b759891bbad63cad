"""
The cost of each feature in a scene that uses it: eight rods without it and with it, in turns.

And its cost in a scene that does not: this kernel against one compiled without it, on the same plain scene.
"""
from __future__ import annotations

import ctypes
from dataclasses import replace
from pathlib import Path
import sys
from typing import Callable, Iterator, Optional

import numpy as np

from .cpu_time import interleaved
from .peers.compiled import compile_shared, Missing
from .problems import Problem, uniform_rods
from .step_time import own_evaluations
from .work_precision import own_integration
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..chain.tree import Body, Joint
from ..mechanics.kernel_model import kernel_arrays
from ..mechanics.path_matrix import merge_welded
from ..mechanics.plan import plan_of

COLUMNS = ('feature', 'in the plan', 'evaluation, ns: without', 'evaluation, ns: with',
           'saved by its absence, ns: median', 'saved by its absence, ns: min', 'RK4 tick, ns: without',
           'RK4 tick, ns: with', 'saved in a tick, ns: median', 'saved in a tick, ns: min',
           'evaluation, ns: given as zero')
LINKS, ROUNDS = 8, 41
STEP, STEPS = 1e-4, 32


def _rotations(**laws) -> Callable[[Chain], Chain]:
    """Return the change that gives every rotation these laws."""
    return lambda chain: replace(chain, bodies=tuple(
        replace(body, rotation=replace(body.rotation, **laws)) for body in chain.bodies))


def _bodies(change: Callable[[int, Body], Body]) -> Callable[[Chain], Chain]:
    return lambda chain: replace(chain, bodies=tuple(change(i, body) for i, body in enumerate(chain.bodies)))


def _off_axis_mass(_: int, body: Body) -> Body:
    center = body.center_of_mass * np.exp(0.3j)
    return replace(body, center_of_mass=complex(center), inertia=body.inertia_com + body.mass * abs(center)**2)


def _welded(chain: Chain) -> Chain:
    """Return the chain cut in two halves of every rod, welded together: the same motion."""
    bodies = []
    for i, body in enumerate(chain.bodies):
        half, mass = body.center_of_mass / 2.0, body.mass / 2.0
        own = mass * abs(body.center_of_mass)**2 / 12.0
        part = replace(body, mass=mass, center_of_mass=half, inertia_com=own, inertia=own + mass * abs(half)**2)
        bodies.append(replace(part, carrier=2 * body.carrier if i else -1))
        bodies.append(replace(part, name=f'{body.name}_outer', carrier=2 * i, origin=body.center_of_mass,
                              rotation=None))
    return replace(chain, bodies=tuple(bodies))


SLIDE = Joint('slide', 'slide', 0.5)
# name: the change that adds the feature, and one that spells out its absence in the data where that can be said
FEATURES: dict[str, tuple[Callable[[Chain], Chain], Optional[Callable[[Chain], Chain]]]] = {
    'gravity': (lambda chain: replace(chain, gravity=-9.81j), lambda chain: replace(chain, gravity=0j)),
    'a slide on the base': (_bodies(lambda i, body: body if i else replace(body, slide=SLIDE)), None),
    'a slide inside': (_bodies(lambda i, body: replace(body, slide=SLIDE) if i == LINKS // 2 else body), None),
    'branches': (_bodies(lambda i, body: replace(body, carrier=(i - 1) // 2 if i else -1)), None),
    'joint offset off the axis (gamma)': (
        _bodies(lambda i, body: replace(body, origin=complex(body.origin * np.exp(0.2j)))), None),
    'mass centre off the axis (eta)': (_bodies(_off_axis_mass), None),
    'damping': (_rotations(damping=0.01), _rotations(damping=0.0)),
    'springs': (_rotations(stiffness=0.1), _rotations(stiffness=0.0)),
    'friction': (_rotations(friction=0.01), _rotations(friction=0.0)),
    'armature': (_rotations(armature=0.01), _rotations(armature=0.0)),
    'stops': (_rotations(lower=-100.0, upper=100.0), _rotations(lower=-np.inf, upper=np.inf)),
    'effort limits': (_rotations(effort_limit=10.0), _rotations(effort_limit=np.inf)),
    'welded halves': (_welded, None),
}


def _loops(chain: Chain) -> list[Optional[Callable[[int], None]]]:
    """Return loops of evaluations and of RK4 ticks; None where the simulation refuses the feature."""
    try:
        run = own_integration(Problem('', lambda: chain, STEPS * STEP, ((), ())), 'rk4', STEP, None)
    except ValueError:
        run = None

    def ticks(count):
        for _ in range(count):
            run.go()
    return [own_evaluations(chain)['auto'], ticks if run else None]


# Plain scenes, each of which another part of the kernel evaluates.
PLAIN = {'4 rods, dense form': lambda: uniform_rods(4, gravity=0j, bend=0.2),
         '8 rods, recursion of serial chains': lambda: uniform_rods(LINKS, gravity=0j, bend=0.2),
         '8 rods that branch, recursion of trees': lambda: FEATURES['branches'][0](
             uniform_rods(LINKS, gravity=0j, bend=0.2))}


class Build:
    """The kernel compiled for this comparison, `bare` without slides, armature and joint laws; Missing."""

    def __init__(self, bare: bool):
        kernel = Path(__file__).resolve().parent.parent / 'kernel'
        headers = sorted(kernel.rglob('*.hpp'))
        if not headers:
            raise Missing('the kernel is installed without its sources')
        self._library = compile_shared(
            Path(__file__).with_name('kernel_loop.cpp'), ['-ffp-contract=off', '-fno-fast-math', '-pthread'] + [
                '-DPLANAR_CHAIN_BARE'] * bare, headers=headers)
        self._library.make.restype = ctypes.c_void_p
        for function in (self._library.evaluate, self._library.roll):
            function.restype = ctypes.c_double

    def loops(self, chain: Chain) -> list[Callable[[int], None]]:
        """Return loops of evaluations and of RK4 ticks of a chain without joint laws."""
        topology, numbers = kernel_arrays(chain, merge_welded(chain)[0])
        gravity = np.array([chain.gravity.real, chain.gravity.imag])
        position, velocity = initial_state(chain)
        scene = ctypes.c_void_p(self._library.make(
            topology.ctypes, numbers.ctypes, len(topology), gravity.ctypes, chain.joint_count,
            int(plan_of(chain).form == 'dense'), ctypes.c_double(STEP)))

        def looped(function):
            return lambda count: function(scene, position.ctypes, velocity.ctypes, ctypes.c_long(count)) and None
        return [looped(self._library.evaluate), looped(self._library.roll)]


def _absences(quick: bool) -> Iterator[tuple]:
    """Yield a row per plain scene: the build without all that it lacks, and the one with everything."""
    try:
        builds = [Build(bare) for bare in (True, False)]
    except Missing as reason:
        print(f'not measured: the kernel against a bare build: {reason}', file=sys.stderr)
        return
    for name, plain in PLAIN.items():
        (evaluate, tick), (evaluate_all, tick_all) = (build.loops(plain()) for build in builds)
        times = [seconds * 1e9 for seconds in interleaved(
            [evaluate, evaluate_all, tick, tick_all], 3 if quick else 3 * ROUNDS, name, budget=2.0)]
        middle, low = [np.median(t) for t in times], [t.min() for t in times]
        yield (f'all absent: {name}', 'against a build without slides, armature and joint laws', *middle[:2],
               middle[1] - middle[0], low[1] - low[0], *middle[2:], middle[3] - middle[2], low[3] - low[2], None)


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield a row of COLUMNS per feature, each against the plain scene in the same turns; then the absences."""
    plain = uniform_rods(LINKS, gravity=0j, bend=0.2)
    for name, (add, zero) in list(FEATURES.items())[:4] if quick else FEATURES.items():
        chains = [plain, add(plain)] + ([zero(plain)] if zero else [])
        new = set(plan_of(chains[1]).used) - set(plan_of(plain).used)
        (evaluate, tick), (evaluate_with, tick_with), *given = map(_loops, chains)
        loops = [evaluate, evaluate_with, *(loop for loop, _ in given), *([tick, tick_with] if tick_with else [])]
        times = interleaved(loops, 3 if quick else ROUNDS, name, budget=2.0)
        middle = [np.median(seconds) * 1e9 for seconds in times]
        low = [seconds.min() * 1e9 for seconds in times]
        ticks = [None] * 4
        if tick_with:
            a, b = middle[-2] / STEPS, middle[-1] / STEPS
            ticks = [a, b, b - a, (low[-1] - low[-2]) / STEPS]
        yield (name, ', '.join(sorted(new)), middle[0], middle[1], middle[1] - middle[0], low[1] - low[0], *ticks,
               middle[2] if zero else None)
    yield from _absences(quick)
