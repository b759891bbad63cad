"""What each feature of a scene costs where it is present: eight rods without it and with it, in turns."""
from __future__ import annotations

from dataclasses import replace
from typing import Callable, Iterator, Optional

import numpy as np

from .cpu_time import interleaved
from .problems import Problem, uniform_rods
from .step_time import own_evaluations
from .work_precision import own_integration
from ..chain import Body, Chain, Joint
from ..plan import plan_of

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


def rows(peers: dict, quick: bool = False) -> Iterator[tuple]:
    """Yield a row of COLUMNS per feature, each against the plain scene measured in the same turns."""
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
