"""
Oracle: Lagrange's equations of a chain at one state, from the positions of the mass centres alone.

Derivatives are central differences in 60 digits, of which some 30 are right: no formula of the method appears here.
"""
from mpmath import expj, mp, mpc, mpf, sign

DIGITS, H = 60, mpf('1e-15')


class LagrangeNumbers:
    """Energies and efforts of a chain as functions of its coordinates; `absolute`: angles against the base."""

    def __init__(self, chain, absolute):
        self.chain, self.absolute = chain, absolute
        self.names = [name for i, body in enumerate(chain.bodies, start=1)
                      for name, joint in ((f'x{i}', body.slide), (f'{"phi" if absolute else "q"}{i}', body.rotation))
                      if joint]

    def places(self, q):
        """Return mass centres and angles of the bodies, and what the joints read, at coordinates q."""
        points, angles, centers, readings, coordinates = {-1: mpc(0)}, {-1: mpf(0)}, [], [], iter(q)
        for i, body in enumerate(self.chain.bodies):
            carrier = angles[body.carrier]
            point, angle = points[body.carrier] + mpc(body.origin) * expj(carrier), carrier + mpf(body.angle)
            if body.slide:
                readings.append(next(coordinates))
                point += readings[-1] * expj(carrier + mpf(body.slide.axis))
            if body.rotation:
                turn, axis = next(coordinates), int(body.rotation.axis)
                readings.append(axis * (turn - angle) if self.absolute else turn)
                angle = turn if self.absolute else angle + axis * turn
            points[i], angles[i] = point, angle
            centers.append(point + mpc(body.center_of_mass) * expj(angle))
        return centers, [angles[i] for i in range(len(centers))], readings

    def rates(self, q, v):
        """Return the derivatives of places by time."""
        ahead, behind = (self.places([x + h * y for x, y in zip(q, v)]) for h in (H, -H))
        return [[(a - b) / (2 * H) for a, b in zip(*pair)] for pair in zip(ahead, behind)]

    def kinetic(self, q, v):
        centers, angles, readings = self.rates(q, v)
        total = sum(mpf(joint.armature) * rate**2 for joint, rate in zip(self.chain.joints, readings))
        for body, center, angle in zip(self.chain.bodies, centers, angles):
            about_center = mpf(body.inertia) - mpf(body.mass) * abs(mpc(body.center_of_mass))**2
            total += mpf(body.mass) * abs(center)**2 + about_center * angle**2
        return total / 2

    def potential(self, q):
        centers, _, readings = self.places(q)
        down = mpc(self.chain.gravity).conjugate()
        return (sum(mpf(joint.stiffness) * (reading - mpf(joint.rest))**2 / 2
                    for joint, reading in zip(self.chain.joints, readings))
                - sum(mpf(body.mass) * (down * center).real for body, center in zip(self.chain.bodies, centers)))

    def momentum(self, q, v, k):
        """Return dT/dq'_k, exactly, as T is a square in the rates."""
        return (self.kinetic(q, moved(v, k, 1)) - self.kinetic(q, moved(v, k, -1))) / 2

    def values(self, names):
        """Return {coordinate: d/dt dT/dq' - dT/dq + dV/dq - Q}; `names` gives the values of coordinates and efforts."""
        with mp.workdps(DIGITS):
            q, v, a = ([mpf(names[name + mark]) for name in self.names] for mark in ('', '_d', '_dd'))
            _, _, joint_rates = self.rates(q, v)
            forces = [mpf(names[f'{"f" if joint.kind == "slide" else "tau"}{i}']) - mpf(joint.damping) * rate
                      - mpf(joint.friction) * sign(rate) for (i, joint), rate in zip(self._joints(), joint_rates)]
            found = {}
            for k, name in enumerate(self.names):
                after, before = (self.momentum([x + h * y for x, y in zip(q, v)], [x + h * y for x, y in zip(v, a)], k)
                                 for h in (H, -H))
                up, down = moved(q, k, H), moved(q, k, -H)
                _, _, shares = self.rates(q, moved([mpf(0)] * len(q), k, 1))   # of the joints' rates in q'_k
                found[name] = float(((after - before) - self.kinetic(up, v) + self.kinetic(down, v) + self.potential(up)
                                     - self.potential(down)) / (2 * H)
                                    - sum(force * share for force, share in zip(forces, shares)))
            return found

    def _joints(self):
        """Return (number of the body, joint) in the order of the chain."""
        return [(i, joint) for i, body in enumerate(self.chain.bodies, start=1)
                for joint in (body.slide, body.rotation) if joint]


def moved(values, k, by):
    """Return the values with one of them moved."""
    return [value + by if i == k else value for i, value in enumerate(values)]
