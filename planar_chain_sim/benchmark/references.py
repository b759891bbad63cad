"""
Where the named problems end: two integrations in many digits that share neither equations nor method.

The first takes moments and forces body by body (virtual power) in mpmath and extrapolates Gragg's midpoint rule; the
second is heyoka's Taylor series of the articulated-body recursion, in its multiple-precision numbers.
"""
from __future__ import annotations

from types import SimpleNamespace
from typing import Iterator

from .problems import Problem, PROBLEMS
from ..chain.chain import Chain
from ..chain.joint_arrays import initial_state
from ..chain.tree import BASE
from ..errors import Mistake

COLUMNS = ('problem', 'quantity', 'mpmath, extrapolation', 'heyoka, Taylor', 'largest difference', 'from the stored')
DIGITS = 29          # of the arithmetic
TOLERANCE = 1e-21    # local error per step, of both
FIRST_STEP = 0.01    # s, of the extrapolation
COLUMN_COUNT = 11    # of the extrapolation table: order 22


class VirtualPower:
    """Accelerations of bodies that turn and perhaps slide: sum over bodies of J^T m (a - g) and J_C, in mpmath."""

    def __init__(self, mp, chain: Chain):
        """Keep the chain's numbers, taken as exact; ValueError: friction, or a body without rotation."""
        if any(body.rotation is None for body in chain.bodies) or any(joint.friction for joint in chain.joints):
            raise ValueError(f'{chain.name}: every body must turn, none rub')
        self.mp, self.chain, self.gravity = mp, chain, mp.mpc(chain.gravity)
        self.column = {joint.name: k for k, joint in enumerate(chain.joints)}
        self.spin_inertia = [mp.mpf(body.inertia) - mp.mpf(body.mass) * self._square(body.center_of_mass)
                             for body in chain.bodies]

    def _square(self, z: complex):
        return self.mp.mpf(z.real)**2 + self.mp.mpf(z.imag)**2

    def accelerations(self, position, velocity):
        """Return q'' as a list, for lists of joint positions and velocities."""
        mp, chain, count = self.mp, self.chain, self.chain.joint_count
        frames, H = [], mp.zeros(count)
        force = mp.matrix([-joint.damping * v - joint.stiffness * (q - joint.rest)
                           for joint, q, v in zip(chain.joints, position, velocity)])
        for k, joint in enumerate(chain.joints):
            H[k, k] = mp.mpf(joint.armature)
        for i, body in enumerate(chain.bodies):
            frame = self._frame(body, frames, position, velocity)
            frames.append(frame)
            arm = mp.mpc(body.center_of_mass) * mp.expj(frame.angle)
            motion = _turned_about(frame.motion, frame.spin, arm)
            pull = body.mass * (self.gravity - frame.acceleration + frame.rate**2 * arm)   # m (g - a_C), q'' = 0
            for k, along in motion.items():
                force[k] += (mp.conj(along) * pull).real
                for other, across in motion.items():
                    turning = self.spin_inertia[i] * frame.spin.get(k, 0) * frame.spin.get(other, 0)
                    H[k, other] += body.mass * (mp.conj(along) * across).real + turning
        return list(mp.lu_solve(H, force))

    def _frame(self, body, frames, position, velocity) -> SimpleNamespace:
        """
        Return where a body is: angle, rate, acceleration of its joint point where q'' = 0.

        And per unit rate of each joint (by column) its `spin` and the velocity of its joint point, `motion`.
        """
        mp = self.mp
        carrier = frames[body.carrier] if body.carrier != BASE else SimpleNamespace(
            angle=mp.mpf(0), rate=mp.mpf(0), acceleration=mp.mpc(0), spin={}, motion={})
        turn, offset, coriolis, sliding = mp.expj(carrier.angle), mp.mpc(body.origin), mp.mpc(0), {}
        if body.slide:
            k = self.column[body.slide.name]
            axis = mp.expj(body.slide.axis)
            offset += position[k] * axis
            sliding, coriolis = {k: axis * turn}, 2j * carrier.rate * velocity[k] * axis * turn
        motion = _turned_about(carrier.motion, carrier.spin, offset * turn) | sliding
        k, sign = self.column[body.rotation.name], int(body.rotation.axis)
        return SimpleNamespace(
            angle=carrier.angle + mp.mpf(body.angle) + sign * position[k], rate=carrier.rate + sign * velocity[k],
            acceleration=carrier.acceleration - carrier.rate**2 * offset * turn + coriolis,
            spin={**carrier.spin, k: sign}, motion=motion)


def _turned_about(motion: dict, spin: dict, arm) -> dict:
    """Return the velocity per unit rate of a point at `arm` from one that has `motion`."""
    moved = dict(motion)
    for k, sign in spin.items():
        moved[k] = moved.get(k, 0) + sign * 1j * arm
    return moved


def extrapolated_motion(chain: Chain, duration: float, position, velocity) -> tuple[list, list]:
    """
    Return joint positions and velocities after `duration` s, in mpmath, from an adaptive extrapolation of order 22.

    Gragg's midpoint rule with 2, 4, 6, ... substeps: Hairer, Norsett, Wanner, Solving ODEs I, II.9.
    """
    from mpmath import mp
    with mp.workdps(DIGITS):
        bodies, count = VirtualPower(mp, chain), chain.joint_count
        state = [mp.mpf(float(value)) for value in (*position, *velocity)]

        def rate(x):
            return x[count:] + bodies.accelerations(x[:count], x[count:])

        time, step = mp.mpf(0), mp.mpf(duration) if duration < FIRST_STEP else mp.mpf(FIRST_STEP)
        while time < duration:
            if step < 1e-5:
                raise Mistake(f'{chain.name}: the extrapolation takes no step that is exact enough at {float(time)} s')
            step = min(step, duration - time)
            new, error = _extrapolate(mp, rate, state, step)
            if error <= TOLERANCE:
                time, state = time + step, new
            factor = 0.9 * (TOLERANCE / max(error, mp.mpf(10)**-60))**(1 / (2 * COLUMN_COUNT - 1))
            step *= min(2, max(mp.mpf('0.3'), factor))
        return state[:count], state[count:]


def _extrapolate(mp, rate, state, step):
    """One basic step: the last entry of the table in (step / substeps)^2, and its distance from the one before."""
    first, rows = rate(state), []
    for j in range(COLUMN_COUNT):
        substeps = 2 * (j + 1)
        h = step / substeps
        before, now = state, [x + h * f for x, f in zip(state, first)]
        for _ in range(substeps - 1):
            before, now = now, [x + 2 * h * f for x, f in zip(before, rate(now))]
        smooth = [(a + b + h * f) / 2 for a, b, f in zip(now, before, rate(now))]
        row = [smooth]
        for k in range(1, j + 1):                              # Aitken and Neville
            ratio = mp.mpf(substeps) / (2 * (j - k + 1))
            row.append([a + (a - b) / (ratio**2 - 1) for a, b in zip(row[k - 1], rows[-1][k - 1])])
        rows.append(row)
    error = max(abs(a - b) / max(1, abs(a)) for a, b in zip(rows[-1][-1], rows[-1][-2]))
    return rows[-1][-1], error


def taylor_motion(chain: Chain, duration: float, position, velocity) -> tuple[list, list]:
    """Return joint positions and velocities after `duration` s from heyoka in multiple precision, as mpmath numbers."""
    import heyoka
    from mpmath import mp

    from .peers.heyoka_expressions import articulated_bodies

    bits = round(DIGITS * 3.33)
    with mp.workdps(DIGITS + 5):
        def number(value):
            return heyoka.real(mp.nstr(value, DIGITS + 4), bits)

        system = articulated_bodies(heyoka, chain, links=_exact_links(mp, chain, number))
        G = mp.matrix(system.to_absolute.tolist())
        start = [number(value) for values in (position, velocity)
                 for value in G * mp.matrix([float(x) for x in values])]
        taylor = heyoka.taylor_adaptive(system.equations, start, fp_type=heyoka.real, prec=bits, compact_mode=True,
                                        tol=heyoka.real(TOLERANCE, bits))
        taylor.propagate_until(heyoka.real(float(duration), bits))
        end = mp.matrix([mp.mpf(str(value)) for value in taylor.state])
        half = len(end) // 2
        return list(G**-1 * end[:half]), list(G**-1 * end[half:])


def _exact_links(mp, chain: Chain, number) -> list:
    """Return links for articulated_bodies with numbers of many digits; no body is welded."""
    links, turns = [], []
    for body in chain.bodies:
        before = turns[body.carrier] if body.carrier != BASE else mp.mpf(0)
        turns.append(before + mp.mpf(body.angle))

        def pair(z):
            return number(z.real), number(z.imag)
        axis = mp.expj(before + mp.mpf(body.slide.axis)) if body.slide else mp.mpc(0)
        links.append(SimpleNamespace(
            carrier=body.carrier + 1, slide=body.slide, rotation=body.rotation, mass=number(mp.mpf(body.mass)),
            inertia=number(mp.mpf(body.inertia)), offset=pair(mp.mpc(body.origin) * mp.expj(before)),
            slide_axis=pair(axis), moment=pair(body.mass * mp.mpc(body.center_of_mass) * mp.expj(turns[-1]))))
    return links


def rows(peers: dict, quick: bool = False, problems: dict[str, Problem] = PROBLEMS) -> Iterator[tuple]:
    """
    Yield rows of COLUMNS: both integrations of every problem and how far they and the stored digits are apart.

    `quick`: of the first problem only.
    """
    try:
        import heyoka  # noqa: F401
        from mpmath import mp
    except ImportError as error:
        raise Mistake(f'references need mpmath and heyoka, the extra [benchmark] ({error})') from None
    for name, problem in list(problems.items())[:1 if quick else None]:
        chain = problem.chain()
        first, second = (motion(chain, problem.duration, *initial_state(chain))
                         for motion in (extrapolated_motion, taylor_motion))
        for quantity, a, b, stored in zip(('position', 'velocity'), first, second, problem.end):
            apart = float(max(abs(x - y) for x, y in zip(a, b)))
            away = float(max(abs(x - mp.mpf(y)) for x, y in zip(a, stored)))
            yield (name, quantity, *(' '.join(mp.nstr(x, 20) for x in values) for values in (a, b)), apart, away)
