"""Long calls: signals and interrupt() end them soon, at a whole tick, and continuing changes no bit."""
from contextlib import contextmanager
import signal
import subprocess
import sys
import threading
from time import monotonic

import numpy as np
from oracles.border_fuzz import FRICTION
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.benchmark.problems import uniform_rods

CHAINS = {'double_pendulum': pcs.load_chain('double_pendulum.yaml'), 'rubbing': FRICTION,
          'four_link_robot': pcs.load_chain('four_link_robot.yaml')}
PATIENCE = 60.0   # s: a call that hears nothing takes hours
ADAPTIVE = [name for name, row in pcs.METHODS.items() if row.adaptive]


class Rung(Exception):
    """The exception of the signal handler of these tests."""


@contextmanager
def rings(seconds, handler=None):
    """Let a signal come after so many seconds; what is inside must end by it."""
    def ring(*_):
        if handler:
            return handler()
        raise Rung
    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def state_of(simulation):
    return [simulation.tick, simulation.time, *(part.tobytes() for part in simulation.checkpoint().state)]


def whole_run(chain, method, step, ticks):
    simulation = pcs.Simulation(chain, method, step)
    simulation.advance(ticks)
    return simulation


@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('name', CHAINS)
def test_interrupted_at_random_times_a_run_has_the_bits_of_a_whole_one(name, method):
    chain, draw, stops = CHAINS[name], np.random.default_rng(1), 0
    ticks = 3000 if name == 'rubbing' else 2_000_000 if method in ADAPTIVE else 100_000
    simulation, end = pcs.Simulation(chain, method), 0
    while simulation.tick < ticks:
        timer = threading.Timer(draw.uniform(0.0, 2e-4 * 1.5**stops), simulation.interrupt)
        timer.start()
        try:
            simulation.advance(ticks - simulation.tick)
        except pcs.Interrupted as error:
            stops += 1
            assert stops < 28, 'each has let it go on for longer'
            assert f'was interrupted at tick {simulation.tick}, t = {simulation.time:.12g} s' in str(error)
        timer.join()
        assert simulation.tick >= end
        end = simulation.tick
    assert stops > 0 or name != 'double_pendulum', 'the others may take less than a millisecond'
    assert state_of(simulation) == state_of(whole_run(chain, method, 1e-3, ticks))
    if simulation.has_events:
        assert simulation.take_events() == whole_run(chain, method, 1e-3, ticks).take_events()


@pytest.mark.parametrize('method', ADAPTIVE)
@pytest.mark.parametrize('name', CHAINS)
def test_interrupted_within_a_tick_of_many_steps_it_is_as_before_the_tick(name, method):
    """The steps within a long tick are discarded; a step that began before the tick and covers its start is kept."""
    chain, draw, stops = CHAINS[name], np.random.default_rng(2), 0
    step = 2.0 if name == 'rubbing' else 500.0
    whole = whole_run(chain, method, step, 3)
    events = whole.take_events()
    simulation = whole_run(chain, method, step, 1)
    told = simulation.take_events()
    while simulation.tick < 2 and stops < 12:
        before = state_of(simulation)
        timer = threading.Timer(draw.uniform(0.0, 1e-3), simulation.interrupt)
        timer.start()
        try:
            simulation.advance_to(2.5 * step) if stops % 2 else simulation.advance(1)
            break
        except pcs.Interrupted:
            stops += 1
            between = simulation.tick == 2   # the stop came behind the whole tick on the way
            assert state_of(simulation) == (state_of(whole_run(chain, method, step, 2)) if between else before)
            fresh = simulation.take_events()
            assert between or not fresh
            told += fresh
        finally:
            timer.join()
    assert stops > 0 or name != 'double_pendulum'
    try:
        simulation.advance(0 if simulation.tick == 3 else 1)
    except pcs.Interrupted:   # by the timer that came after the end
        pass
    simulation.advance_to(3.0 * step)
    told += simulation.take_events()
    if simulation.time == whole.time:
        assert [part for part in state_of(simulation)[2:4]] == [part for part in state_of(whole)[2:4]]
        assert told == events or not events


@pytest.mark.parametrize('method', ADAPTIVE)
def test_interrupted_among_events_sliding_and_standing_joints_are_as_before_the_tick(method):
    """The tick before has left steps under way, and each tick has many events."""
    joints = ({'friction': 1e-4, 'velocity': 3.0}, {'lower': -1.0, 'upper': 1.5, 'restitution': 1.0})
    chain = pcs.chain_from_dict({'name': 'creaking', 'bodies': [
        {'name': name, 'carrier': carrier, 'origin': origin, 'mass': 1.0, 'center_of_mass': [0.5, 0.0],
         'inertia_com': 0.1, 'rotation': {'joint': f'to_{name}', **joint}}
        for name, carrier, origin, joint in (('a', 'base', [0.0, 0.0], joints[0]), ('b', 'a', [1.0, 0.0], joints[1]))]})
    draw, stops, step, ticks = np.random.default_rng(3), 0, 20.0, 6
    simulation, whole = pcs.Simulation(chain, method, step), whole_run(chain, method, step, ticks)
    simulation.advance(1)
    events = simulation.take_events()
    while simulation.tick < ticks:
        before, counted = state_of(simulation), simulation.statistics['events']
        timer = threading.Timer(draw.uniform(0.0, 5e-3), simulation.interrupt if stops < 8 else int)
        timer.start()
        try:
            simulation.advance(1)
        except pcs.Interrupted:
            stops += 1
            assert stops < 20, 'a stop that has been heard is over'
            assert state_of(simulation) == before and not simulation.take_events()
            assert simulation.statistics['events'] == counted
        timer.join()
        events += simulation.take_events()
    assert stops > 0 and len(events) > 20
    assert state_of(simulation) == state_of(whole) and events == whole.take_events()
    assert simulation.statistics['events'] == whole.statistics['events']


@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('step', [1e-3, 1.0])
def test_a_signal_ends_a_billion_ticks(method, step):
    chain = uniform_rods(32 if step == 1e-3 else 2)
    simulation = pcs.Simulation(chain, method, step)
    try:
        with rings(0.1), pytest.raises(Rung):
            simulation.advance(10**9)
    except pcs.SimulationError:
        pytest.skip('this step is too long for the method')
    assert simulation.tick < 10**9 and simulation.time == simulation.tick * step
    twin = whole_run(chain, method, step, simulation.tick)
    assert state_of(twin) == state_of(simulation)


@pytest.mark.parametrize('method', ADAPTIVE)
def test_a_signal_ends_a_tick_without_end(method):
    simulation = pcs.Simulation(CHAINS['double_pendulum'], method, 1e9)
    start = state_of(simulation)
    for call in (lambda: simulation.advance(1), lambda: simulation.advance_to(3e8)):
        with rings(0.1), pytest.raises(Rung):
            call()
        assert state_of(simulation) == start


@pytest.mark.parametrize('method', ['rk4', 'taylor', 'dop853'])
@pytest.mark.parametrize('threads', [1, 2, 5])
@pytest.mark.parametrize('name', ['double_pendulum', 'rubbing'])
def test_a_signal_ends_a_batch(name, threads, method):
    chain = CHAINS[name]
    scenes = np.zeros((7, chain.joint_count))
    with rings(0.1), pytest.raises(Rung):
        pcs.rollout_batch(chain, scenes, duration=1e8, method=method, threads=threads, every_tick=False)
    assert pcs.rollout_batch(chain, scenes, duration=0.01, method=method).failures == {}


def test_a_stop_that_comes_early_ends_the_next_call_and_no_other():
    simulation = pcs.Simulation(CHAINS['double_pendulum'])
    simulation.interrupt()
    simulation.interrupt()
    with pytest.raises(pcs.Interrupted, match='double_pendulum was interrupted at tick 0'):
        simulation.advance(1)
    simulation.advance(1)
    assert simulation.tick == 1


def test_rows_that_were_recorded_before_the_stop_are_those_of_a_whole_run():
    chain = CHAINS['double_pendulum']
    rows = [np.full((200_000, 2), np.nan) for _ in range(3)]
    simulation = pcs.Simulation(chain, 'rk4')
    with rings(0.005), pytest.raises(Rung):
        simulation.advance(200_000, None, tuple(rows))
    done = simulation.tick
    assert all(np.isfinite(part[:done]).all() and np.isnan(part[done:]).all() for part in rows)
    assert rows[0][done - 1].tobytes() == simulation.position.tobytes()


def test_a_handler_during_a_call_may_only_call_interrupt():
    simulation, refused = pcs.Simulation(CHAINS['double_pendulum']), []

    def ask():
        for call in (lambda: simulation.position, lambda: simulation.acceleration, lambda: simulation.tick,
                     simulation.checkpoint, lambda: simulation.advance(1), simulation.clear_wrenches,
                     lambda: simulation.set_wrench('upper_rod'), simulation.take_events):
            try:
                call()
            except RuntimeError as error:
                refused.append(str(error))
        simulation.interrupt()
    with rings(0.05, ask), pytest.raises(pcs.Interrupted):
        simulation.advance(10**9)
    assert len(refused) == 8 and set(refused) == {
        'the simulation is in the middle of a call of this thread: ask it again when that has returned'}
    simulation.advance(1)


def test_a_signal_reaches_a_thread_that_waits_for_another_ones_call():
    simulation = pcs.Simulation(CHAINS['double_pendulum'])

    def work():
        with pytest.raises(pcs.Interrupted):
            simulation.advance(10**10)
    thread = threading.Thread(target=work)
    thread.start()
    end, rung = monotonic() + PATIENCE, False
    while not rung:   # until the other call has begun, none is waited for
        assert monotonic() < end
        try:
            with rings(0.05):
                simulation.position
        except Rung:
            rung = True
    simulation.interrupt()
    thread.join(PATIENCE)
    assert not thread.is_alive() and simulation.tick > 0


def test_a_signal_ends_a_batch_that_fills_up_rows_of_ended_scenes():
    """The rows that are left take 9.6 GB; after a stop few of them have been touched."""
    program = (
        'import resource, signal, numpy as np, planar_chain_sim as pcs\n'
        'class Stop(Exception): pass\n'
        'def stop(*_): raise Stop\n'
        'signal.signal(signal.SIGALRM, stop)\n'
        'chain = pcs.load_chain("double_pendulum.yaml")\n'
        'still, fast = [[0.0, 0.0]], [[1e300, 0.0]]\n'
        'pcs.rollout_batch\n'
        'signal.setitimer(signal.ITIMER_REAL, 0.1)\n'
        'try: pcs.rollout_batch(chain, still, fast, duration=2e5, step=1e-3, threads=1, method="rk4")\n'
        'except Stop: print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024)\n')
    done = subprocess.run([sys.executable, '-c', program], capture_output=True, text=True)
    assert done.stdout and int(done.stdout) < 4000, (done.stdout, done.stderr)
