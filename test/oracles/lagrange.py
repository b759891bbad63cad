"""Oracle: Lagrange's equations of a chain, derived by SymPy from the positions of the mass centres alone."""
from cmath import phase

import sympy


class Lagrange:
    """
    T, V, dissipation and the work of efforts as SymPy makes them; no formula of the method appears here.

    Symbols: phi1, x1 or q1 with _d and _dd for derivatives, tau1 or f1; `constant(kind, body, number)` is the SymPy
    value of a datum.
    """

    def __init__(self, chain, absolute, constant):
        self.chain, self.absolute = chain, absolute
        self.coordinates, self.rates, self.accelerations = [], [], []
        self.potential = self.kinetic = self.dissipation = self.power = sympy.Integer(0)
        frames = {-1: (sympy.Integer(0), sympy.Integer(0), sympy.zeros(2, 1))}    # phi, phi', position of P
        self._moves = {}
        for i, body in enumerate(chain.bodies):
            phi_, dphi_, place = frames[body.carrier]
            place = place + self._polar('r', 'gamma', i, body.origin, phi_, constant)
            if body.slide:
                x = self._coordinate('x', i, body.slide, constant)
                epsilon = constant('epsilon', i, body.slide.axis)
                place = place + x * sympy.Matrix([sympy.cos(phi_ + epsilon), sympy.sin(phi_ + epsilon)])
            beta = constant('beta', i, body.angle)
            if body.rotation is None:
                phi, dphi = phi_ + beta, dphi_
            elif absolute:
                phi, dphi = self._absolute(i, phi_, dphi_, beta, body.rotation, constant)
            else:
                axis = int(body.rotation.axis)
                phi = phi_ + beta + axis * self._coordinate('q', i, body.rotation, constant)
                dphi = dphi_ + axis * self.rates[-1]
            frames[i] = phi, dphi, place
            center = place + self._polar('c', 'eta', i, body.center_of_mass, phi, constant)
            self._add_body(i, body, center, dphi, constant)

    def _polar(self, length, angle, i, value, phi, constant):
        size = constant(length, i, abs(value))
        if value == 0:
            return sympy.zeros(2, 1)
        direction = phi + constant(angle, i, phase(value))
        return size * sympy.Matrix([sympy.cos(direction), sympy.sin(direction)])

    def _new(self, letter, i):
        symbols = [sympy.Symbol(f'{letter}{i + 1}{mark}', real=True) for mark in ('', '_d', '_dd')]
        for kept, symbol in zip((self.coordinates, self.rates, self.accelerations), symbols):
            kept.append(symbol)
        return symbols[0], symbols[1]

    def _coordinate(self, letter, i, joint, constant):
        coordinate, rate = self._new(letter, i)
        self._laws(i, joint, coordinate, rate, constant)
        return coordinate

    def _absolute(self, i, phi_, dphi_, beta, joint, constant):
        phi, dphi = self._new('phi', i)
        axis = int(joint.axis)
        self._laws(i, joint, axis * (phi - phi_ - beta), axis * (dphi - dphi_), constant)
        return phi, dphi

    def _laws(self, i, joint, relative, rate, constant):
        """Effort, spring, damper and rotor act on the coordinate that the chain file's joint reads."""
        effort = sympy.Symbol(f'{"f" if joint.kind == "slide" else "tau"}{i + 1}', real=True)
        self.power += effort * rate
        self.potential += constant('k', i, joint.stiffness) * (relative - joint.rest)**2 / 2
        self.dissipation += constant('d', i, joint.damping) * rate**2 / 2
        self.kinetic += constant('Ia', i, joint.armature) * rate**2 / 2

    def _add_body(self, i, body, center, dphi, constant):
        velocity = sympy.zeros(2, 1)
        for coordinate, rate in zip(self.coordinates, self.rates):
            velocity += center.diff(coordinate) * rate
        mass = constant('m', i, body.mass)
        about_center = constant('J', i, body.inertia) - mass * constant('c', i, abs(body.center_of_mass))**2
        self.kinetic += mass * (velocity.T * velocity)[0] / 2 + about_center * dphi**2 / 2
        for k, g in enumerate((self.chain.gravity.real, self.chain.gravity.imag)):
            self.potential -= mass * constant('g', k, g) * center[k]

    def residuals(self):
        """Return d/dt dT/dq' - dT/dq + dV/dq - Q for every coordinate, as expressions."""
        rows = []
        for coordinate, rate in zip(self.coordinates, self.rates):
            momentum = self.kinetic.diff(rate)
            row = sum(momentum.diff(other_rate) * acceleration + momentum.diff(other) * other_rate
                      for other, other_rate, acceleration in zip(self.coordinates, self.rates, self.accelerations))
            row += (self.potential - self.kinetic).diff(coordinate) + self.dissipation.diff(rate)
            row -= self.power.diff(rate)
            rows.append(row)
        return rows
