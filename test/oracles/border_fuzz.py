"""
Random arguments for the kernel's border: each call returns a result or raises an error, and never does worse.

`make fuzz` runs this with a kernel that watches its memory, `make races` with one that watches its threads. `--seed`
repeats a run.
"""
from argparse import ArgumentParser
import copy
from dataclasses import replace
import faulthandler
import pickle
import signal
import sys
from threading import Thread
from time import monotonic
import warnings

import numpy as np

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.motion.integrators import method_data

FRICTION = pcs.chain_from_dict({'name': 'rubbing', 'bodies': [
    {'name': 'a', 'carrier': 'base', 'mass': 1.0, 'inertia': 0.5, 'center_of_mass': [0.5, 0.0],
     'rotation': {'joint': 'j', 'friction': 0.3, 'lower': -1.0, 'upper': 1.0}},
    {'name': 'b', 'carrier': 'a', 'origin': [1.0, 0.0], 'mass': 1.0, 'inertia': 0.5, 'center_of_mass': [0.5, 0.0],
     'rotation': {'joint': 'k', 'damping': 0.1}},
    {'name': 'c', 'carrier': 'b', 'mass': 1.0, 'inertia': 0.5,
     'slide': {'joint': 's', 'axis': 0.5, 'stiffness': 200.0, 'friction': 0.2}}]})
CHAINS = [pcs.load_chain('double_pendulum.yaml'), pcs.load_chain('four_link_robot.yaml'), FRICTION]
REFUSALS = (ValueError, TypeError, BufferError, pcs.SimulationError, pcs.Interrupted, MemoryError)
PATIENCE = 0.3   # s for one call


class Late(Exception):
    """Raised by the timer's signal during a long call."""


def raise_late(*_):
    raise Late


class Junk:
    """Random arguments of a function: some valid, most of them not."""

    def __init__(self, seed):
        self.random, self.wild = np.random.default_rng(seed), 0.0

    def calm_down(self):
        """Choose how often the next arguments are invalid: much of a call only runs if most arguments are valid."""
        self.wild = self.one_of(0.0, 0.03, 0.2)

    def beside(self):
        return self.random.random() < self.wild

    def one_of(self, *choices):
        return choices[self.random.integers(len(choices))]

    def number(self):
        return self.one_of(0, 1, 3, -1, True, 2**31, 2**53, 2**63, -2**70, 0.0, -0.0, 1e-3, 0.5, 1e300, -1e300, 5e-324,
                           np.nan, np.inf, -np.inf, np.float64(0.1), np.int64(7), None, '1', 1j, [])

    def size(self, wanted):
        return wanted if not self.beside() else int(self.one_of(0, 1, wanted + 1, max(0, wanted - 1), 17))

    def array(self, *shape):
        """Return an array of about this shape: wrong in size, type, order, place in memory or value now and then."""
        values = self.random.normal(size=tuple(map(self.size, shape)))
        kind = self.random.integers(8) if shape and self.beside() else None
        if kind == 0 and values.size:
            values.flat[self.random.integers(values.size)] = self.one_of(np.nan, np.inf, 1e300, -1e160, 5e-324)
        elif kind == 1:
            values = values.astype(self.one_of(np.float32, np.int64, '>f8', complex, object, bool))
        elif kind == 2:
            values = np.asfortranarray(values)
        elif kind == 3:
            values = np.repeat(values, 2, axis=-1)[..., ::self.one_of(2, -2)]
        elif kind == 4:
            raw = np.zeros(values.nbytes + 1, dtype=np.uint8)
            raw[1:] = np.frombuffer(values.tobytes(), dtype=np.uint8)
            values = raw[1:].view(np.float64).reshape(values.shape)   # at an odd address
        elif kind == 5:
            values.flags.writeable = False
        elif kind == 6:
            values = np.broadcast_to(values[..., :1], values.shape)
        elif kind == 7:
            return self.one_of(None, self.number(), values.tolist(), 'array', memoryview(np.ascontiguousarray(values)),
                               np.float64(1.0), (), {}, values.view(np.matrix) if values.ndim == 2 else values)
        return values

    def arguments(self, *wanted):
        """Return the arguments, some replaced or missing."""
        given = [value if not self.beside() else self.one_of(self.number(), self.array(2), (), None)
                 for value in wanted]
        return given[:-1] if self.wild > 0.1 and self.random.random() < 0.05 else given


def sum_of_bits(numbers):
    """Sum as the kernel makes it, so that damage comes further than to the sum."""
    total = 0xcbf29ce484222325
    for bits in np.asarray(numbers, dtype=np.float64).view(np.uint64).tolist():
        total = ((total ^ bits) * 0x100000001b3) % 2**64
        total ^= total >> 29
    return float(total >> 12)


class Fuzz:
    """Calls into the kernel, each by one method; state is kept between them."""

    def __init__(self, seed):
        self.junk, self.random = Junk(seed), np.random.default_rng(seed + 1)
        self.renew()

    def renew(self):
        chain = self.junk.one_of(*CHAINS)
        name = self.junk.one_of(*pcs.METHODS)
        self.simulation = pcs.Simulation(chain, name, self.junk.one_of(1e-3, 1e-2, 0.1))
        self.chain, self.model, self.joints = chain, plan_of(chain).model, chain.joint_count

    def stepper(self):
        made = _kernel.Stepper(*self.junk.arguments(self.model, self.data(), self.junk.one_of(1e-3, 1.0, 1e6),
                                                    self.junk.one_of(True, False)))
        made.advance(3, None, None)

    def data(self):
        method = pcs.METHODS[self.junk.one_of(*pcs.METHODS)]
        return method_data(method, 1e-9 if method.adaptive else None)

    def method(self):
        junk = self.junk
        family = 'nonsense' if junk.beside() else junk.one_of(*_kernel.FAMILIES)
        stages = int(junk.size(3))
        tableau = _kernel.Tableau(*junk.arguments(stages, *(
            junk.random.normal(size=junk.size(count)).tolist()
            for count in (stages**2, stages, stages + 1, 0, 0, stages**2)), 0.3))
        data = _kernel.MethodData(*junk.arguments(family, int(junk.size(6)), junk.one_of(True, False), 1e-6,
                                                  junk.one_of(0.0, 1e-2), tableau))
        _kernel.Stepper(self.model, data, 1e-3, junk.one_of(True, False)).advance(2, None, None)

    def advance(self):
        junk, n = self.junk, self.joints
        ticks = int(junk.one_of(0, 1, 1, 3, 40))
        record = tuple(junk.array(ticks, n) for _ in range(junk.size(3))) if junk.random.random() < 0.5 else None
        call = junk.one_of(self.simulation.advance, self.simulation._stepper.advance)
        call(*junk.arguments(junk.number() if junk.beside() else ticks,
                             junk.one_of(None, junk.array(n), junk.array(ticks, n)), record))

    def advance_to(self):
        junk = self.junk
        self.simulation.advance_to(*junk.arguments(
            self.simulation.time + junk.one_of(0.0, self.simulation.step, 0.3e-3, 1e-17, -1.0, 1e18),
            junk.one_of(None, junk.array(self.joints), junk.array(2, self.joints))))

    def advance_kernel_to(self):
        junk, tick = self.junk, self.simulation.tick
        self.simulation._stepper.advance_to(*junk.arguments(
            tick + junk.one_of(0, 1, 5), junk.one_of(None, self.simulation.time), junk.array(self.joints)))

    def state(self):
        put = self.junk.one_of(self.simulation.set_state, self.simulation._stepper.put_state)
        put(*self.junk.arguments(0.1 * self.junk.random.normal(size=self.joints), self.junk.array(self.joints)))

    def load(self):
        """Parts of one method's state, damaged, into another."""
        junk = self.junk
        other = pcs.Simulation(self.chain, junk.one_of(*pcs.METHODS), self.simulation.step)
        other.advance(int(junk.random.integers(5)))
        tick, between, state = junk.one_of(other, self.simulation)._stepper.save()
        state = list(state)
        steps = state[5].copy()
        for _ in range(junk.random.integers(4)):
            at = junk.random.integers(len(steps))
            steps[at] = junk.one_of(0.0, 1.0, 2.0, 3.0, 4.0, -1.0, 1e18, 1e300, np.nan, np.inf, steps[at] * (1 + 1e-9))
        if junk.random.random() < 0.2:
            steps = steps[:junk.random.integers(len(steps))]
        if junk.random.random() < 0.8 and len(steps):
            steps[-1] = sum_of_bits(steps[:-1])
        state[5] = steps
        if junk.random.random() < 0.1:
            state[junk.random.integers(6)] = junk.array(self.joints)
        into = copy.copy(self.simulation)._stepper
        into.load(*junk.arguments(junk.number() if junk.beside() else tick, between, tuple(state),
                                  junk.one_of(True, False, False)))
        into.advance(3, None, None)

    def restore(self):
        saved, junk = self.simulation.checkpoint(), self.junk
        self.simulation.restore(replace(saved, **{junk.one_of(*vars(saved)): junk.number()}))

    def copies(self):
        made = self.junk.one_of(copy.copy, copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one)))(self.simulation)
        ends = []
        for one in (made, self.simulation):
            try:
                one.advance(2)
            except pcs.SimulationError:
                pass
            ends.append(one.position.tobytes())
        assert ends[0] == ends[1], f'a copy goes elsewhere: {self.simulation.plan}, {made.checkpoint()}'

    def wrenches(self):
        junk = self.junk
        for changed in (self.simulation, copy.copy(self.simulation)._stepper):
            body = junk.one_of(*self.simulation.chain.bodies).name
            changed.set_wrench(*junk.arguments(body, (1.0, 2.0), 0.5, junk.one_of('body', 'world')))
        if junk.beside():
            self.simulation.clear_wrenches()

    def payload(self):
        if self.simulation.payloads:
            self.simulation.drop()
        else:
            self.simulation.attach(*self.junk.arguments(self.chain.bodies[-1].name, 0.5, (0.1, 0.0), 0.01))

    def properties(self):
        for name in PROPERTIES:
            getattr(self.simulation, name)

    def instants(self):
        junk, n = self.junk, self.joints
        dense = junk.one_of(True, False)
        call, count = junk.one_of(
            (self.model.forward_dynamics, 3), (self.model.inverse_dynamics, 3), (self.model.mass_matrix, 1),
            (self.model.derivatives, 3), (self.model.energy, 2), (self.model.linearize, 3),
            (self.model.largest_rate, 2),
            (lambda q, v, u: self.model.forward_dynamics(q, v, u, dense), 3),
            (lambda q, v, u: self.model.evaluate_repeatedly(q, v, u, int(junk.size(3)), dense), 3),
            (lambda q, v, u: self.model.repeat(junk.one_of(*REPEATED), q, v, u, 2, dense), 3))
        call(*junk.arguments(*(junk.array(n) for _ in range(count))))

    def numbers(self):
        """Take arrays of any number of dimensions, angles however far."""
        junk = self.junk
        shape = [int(junk.random.integers(4)) for _ in range(junk.random.integers(4))]
        given = _kernel.finite_array('x', junk.number() if junk.beside() else junk.array(*shape), shape)
        assert given.shape == tuple(shape) and np.isfinite(given).all()
        assert _kernel.finite_rows('x', np.zeros((*shape, 2)), 2).shape == (*shape, 2)
        _kernel.finite_rows(*junk.arguments('x', junk.array(*shape), junk.one_of(0, 1, 2)))
        _kernel.plane_vector(*junk.arguments('x', junk.one_of(junk.array(2), (junk.number(), junk.number()))))
        _kernel.unit_vector(junk.one_of(1e300, 1.7e308, 5e-324, np.nan, np.inf, junk.random.normal() * 1e9))

    def takeover(self):
        """Put a stepper in the place of another, of the same joints or not."""
        junk, twin = self.junk, copy.copy(self.simulation)._stepper
        other = pcs.Simulation(junk.one_of(self.chain, *CHAINS), junk.one_of(*pcs.METHODS))._stepper
        other.advance(int(junk.one_of(0, 3)), None, None)
        twin.adopt(*junk.arguments(junk.one_of(other, other, twin), junk.one_of(True, False)))
        for one in (twin, other):
            one.advance(2, None, None)
        twin.take_coarse_step()
        twin.take_events()

    def models(self):
        junk = self.junk
        links = int(junk.random.integers(1, 4))
        topology = np.array([[k, -1, k] for k in range(links)], dtype=np.int32)
        if junk.beside():
            topology[tuple(junk.random.integers(topology.shape))] = junk.one_of(-2, -1, 0, 1, 2, 3, 100, -2**31)
        model = _kernel.Model(*junk.arguments(
            junk.array(links, 3) if junk.beside() else topology,
            junk.one_of(np.abs(junk.random.normal(size=(links, 12))), junk.array(links, 12)), (0.0, -9.81),
            int(junk.size(links))))
        for name, count in (('damping', 1), ('spring', 2), ('friction', 1), ('effort_limit', 1), ('stop', 3)):
            if junk.random.random() < 0.3:
                model.add_law(*junk.arguments(
                    junk.one_of(name, name, name, *['', 'sprung'] * junk.beside()),
                    junk.one_of(0, 0, links - 1, -junk.beside(), 2),
                    [-1.0, 1.0, 0.5][:junk.one_of(count, count, *[0, 3] * junk.beside())]
                    if name == 'stop' else [0.5] * junk.one_of(count, count, *[0, 7] * junk.beside())))
        made = _kernel.Stepper(model, self.data(), 1e-3, junk.one_of(True, False))
        for _ in range(1 + junk.beside()):
            model.place_bodies(*junk.arguments(['a', 'b'], [tuple(junk.arguments(
                int(junk.size(links)), 0.1j, 0.2, 1.0 + 1j)) for _ in range(junk.size(2))]))
            made.set_wrench(*junk.arguments(junk.one_of('a', 'b'), junk.array(2), 0.5, 'body'))
            made.advance(3, None, None)

    def batch(self):
        junk, n, scenes, ticks = self.junk, self.joints, int(self.junk.random.integers(1, 10)), 5
        many = junk.one_of(1, scenes)
        data = self.data()
        _kernel.roll_batch(*junk.arguments(
            [tuple(junk.arguments(self.model, junk.one_of(True, False), data)) for _ in range(many)], 1e-3,
            junk.one_of(ticks, ticks, *[0, 10**15] * junk.beside()), junk.array(scenes, n), junk.array(scenes, n),
            junk.array(junk.one_of(1, scenes), junk.one_of(1, ticks), n), junk.one_of(True, False),
            int(junk.size(2)), int(junk.one_of(*_kernel.vector_widths(), 0, 1, *[3, -1, 8] * junk.beside()))))

    def states(self):
        junk, n, count = self.junk, self.joints, int(self.junk.random.integers(1, 10))
        made = _kernel.StateBatch(*junk.arguments(self.model, *(junk.array(count, n) for _ in range(3)),
                                                  junk.one_of(True, False)))
        made.evaluate(2)
        made.accelerations()

    def messages(self):
        junk = self.junk
        chunk = _kernel.LogChunk()
        for _ in range(3):
            chunk.add_record(*junk.arguments(bytes(junk.random.integers(256, size=5, dtype=np.uint8))))
            chunk.add_message(*junk.arguments(junk.one_of(0, 1, 65535), junk.one_of(5, 2**64 - 1),
                                              junk.one_of(b'abc', junk.array(3)), 7, 1))
        chunk.take()
        _kernel.json_list(junk.array(self.joints))
        head = np.array([256, 0, 0, self.joints, 0], dtype=np.uint32).tobytes()
        _kernel.plain_command(*junk.arguments(head + junk.random.normal(size=junk.size(self.joints)).tobytes(),
                                              junk.array(self.joints), 3, 'topic'))


REPEATED = ('forward_dynamics', 'inverse_dynamics', 'mass_matrix', 'energy', 'linearize', 'nonsense')
PROPERTIES = ('tick', 'time', 'position', 'velocity', 'effort', 'acceleration', 'statistics', 'has_events', 'plan',
              'wrenches', 'wrench_effort', 'payloads', 'chain', 'step', 'tolerance', 'method', 'form')
CALLS = [name for name, value in vars(Fuzz).items() if callable(value) and name not in ('__init__', 'renew', 'data')]


def fuzz(seconds, seed):
    """Call anything with anything; return how often each call was taken and how often refused."""
    signal.signal(signal.SIGALRM, raise_late)
    fuzzer, told, end = Fuzz(seed), {name: [0, 0] for name in CALLS}, monotonic() + seconds
    while monotonic() < end:
        if fuzzer.random.random() < 0.05:
            fuzzer.renew()
        name = CALLS[fuzzer.random.integers(len(CALLS))]
        fuzzer.junk.calm_down()
        refused = 0
        try:
            signal.setitimer(signal.ITIMER_REAL, PATIENCE)
            getattr(fuzzer, name)()
        except REFUSALS:
            refused = 1
        except Late:
            pass
        finally:
            try:
                signal.setitimer(signal.ITIMER_REAL, 0.0)
            except Late:
                pass
        told[name][refused] += 1
    return told


def uses(simulation, saved, seed):
    """Return all that a thread may do with a simulation."""
    chain, draw = simulation.chain, np.random.default_rng(seed)
    last = chain.bodies[-1].name
    return [*(lambda name=name: getattr(simulation, name) for name in PROPERTIES),
            lambda: simulation.advance(int(draw.integers(1, 300))), lambda: simulation.advance(1),
            lambda: simulation.advance(40, np.zeros(chain.joint_count), tuple(
                np.empty((40, chain.joint_count)) for _ in range(3))),
            lambda: simulation.advance_to(simulation.time + 0.0107), simulation.interrupt, simulation.take_events,
            lambda: simulation.set_state(*initial_state(chain)), lambda: simulation.restore(saved),
            lambda: simulation.restore(simulation.checkpoint()), lambda: copy.copy(simulation).advance(3),
            lambda: pickle.loads(pickle.dumps(simulation)).advance(3), lambda: simulation.replace_chain(chain),
            lambda: simulation.set_wrench(last, (1.0, 2.0), 0.3), simulation.clear_wrenches,
            lambda: simulation.attach(last, 0.1), simulation.drop,
            lambda: pcs.forward_dynamics(chain, *initial_state(chain), np.zeros(chain.joint_count)),
            lambda: pcs.rollout_batch(chain, np.zeros((9, chain.joint_count)), duration=0.02, threads=3,
                                      method=simulation.method)]


def races(seconds, seed):
    """Let four threads use one simulation in every way."""
    draw, end, done = np.random.default_rng(seed), monotonic() + seconds, {}
    failures = []
    while monotonic() < end and not failures:
        chain = CHAINS[draw.integers(len(CHAINS))]
        simulation = pcs.Simulation(chain, list(pcs.METHODS)[draw.integers(len(pcs.METHODS))])
        saved, until = simulation.checkpoint(), monotonic() + 1.0

        def use(seed):
            choose, ways = np.random.default_rng(seed), uses(simulation, saved, seed)
            while monotonic() < until:
                number = int(choose.integers(len(ways)))
                try:
                    ways[number]()
                except REFUSALS:
                    pass
                except BaseException as error:
                    failures.append(error)
                    raise
                done[number] = done.get(number, 0) + 1
        threads = [Thread(target=use, args=(int(draw.integers(2**31)),)) for _ in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    if failures:
        raise failures[0]
    return {'uses': [sum(done.values()), len(done)]}


def main():
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=60.0)
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--races', action='store_true')
    options = parser.parse_args()
    faulthandler.enable()
    warnings.simplefilter('ignore')
    np.seterr(all='ignore')
    told = (races if options.races else fuzz)(options.seconds, options.seed)
    print(f'{_kernel.__file__}, seed {options.seed}:', ', '.join(
        f'{name} {taken} + {refused}' for name, (taken, refused) in told.items()))


if __name__ == '__main__':
    sys.exit(main())
