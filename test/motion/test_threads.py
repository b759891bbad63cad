"""One simulation in several threads: calls wait for each other, and none changes the motion."""
import pickle
import sys
from threading import Thread

import numpy as np
from oracles.border_fuzz import FRICTION, PROPERTIES, races
import pytest

import planar_chain_sim as pcs

CHAINS = {'double_pendulum': pcs.load_chain('double_pendulum.yaml'), 'rubbing': FRICTION}
READ = (*PROPERTIES, 'checkpoint')


def run_all(*work):
    """Run functions in a thread each; raise what one of them raised."""
    failures = []

    def guarded(function):
        try:
            function()
        except BaseException as error:
            failures.append(error)
    threads = [Thread(target=guarded, args=(function,)) for function in work]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    if failures:
        raise failures[0]


def read(simulation, name):
    value = getattr(simulation, name)
    return value() if callable(value) else value


@pytest.mark.parametrize('method', pcs.METHODS)
@pytest.mark.parametrize('name', CHAINS)
def test_a_reading_thread_changes_no_bit_and_sees_whole_calls(name, method):
    """Every property; each advance is one call, so that only its ends are ever seen."""
    chain, ticks = CHAINS[name], 15 if name == 'rubbing' else 150
    simulation, seen, going, calls = pcs.Simulation(chain, method), [], [True], 0

    def advance():
        nonlocal calls
        try:
            while len(seen) < 20:
                simulation.advance(ticks)
                calls += 1
        finally:
            going.clear()

    def look():
        while going:
            for each in READ:
                read(simulation, each)
            seen.append((simulation.tick, simulation.position.tobytes()))
    run_all(advance, look, look)
    whole = pcs.Simulation(chain, method)
    ends = {whole.position.tobytes()}
    for _ in range(calls):
        whole.advance(ticks)
        ends.add(whole.position.tobytes())
    assert [part.tobytes() for part in simulation.checkpoint().state] == [
        part.tobytes() for part in whole.checkpoint().state]
    assert {tick % ticks for tick, _ in seen} == {0} and {position for _, position in seen} <= ends


@pytest.mark.parametrize('method', pcs.METHODS)
def test_ticks_of_several_threads_add_up_to_one_run(method):
    chain = CHAINS['double_pendulum']
    simulation, whole = pcs.Simulation(chain, method), pcs.Simulation(chain, method)
    whole.advance(4 * 6 * 50)

    def advance():
        for _ in range(6):
            simulation.advance(50)
    run_all(*[advance] * 4)
    assert simulation.tick == 1200 and simulation.time == 1200 * 1e-3
    assert simulation.position.tobytes() == whole.position.tobytes()


def test_a_model_that_is_measured_in_one_thread_answers_others():
    chain = pcs.load_chain('four_link_robot.yaml')
    position, zero = np.full(5, 0.3), np.zeros(5)
    wanted = pcs.forward_dynamics(chain, position, zero, zero).tobytes()
    from planar_chain_sim.mechanics.plan import plan_of
    model, going = plan_of(chain).model, [True]

    def measure():
        for _ in range(5):
            model.evaluate_repeatedly(zero, zero, zero, 20000)
        going.clear()

    def ask():
        while going:
            assert pcs.forward_dynamics(chain, position, zero, zero).tobytes() == wanted
    run_all(measure, ask)


def test_every_use_in_every_thread_at_once():
    assert races(seconds=3.0, seed=5)['uses'][0] > 100


def test_a_chain_is_pickled_while_another_thread_computes_what_is_kept_with_it():
    chain, interval, going = CHAINS['double_pendulum'], sys.getswitchinterval(), [True]

    def compute():
        while going:
            for k in range(100):
                chain.__dict__[f'_kept_{k}'] = k
            for k in range(100):
                del chain.__dict__[f'_kept_{k}']

    def copy():
        try:
            for _ in range(300):
                assert pickle.loads(pickle.dumps(chain)) == chain
        finally:
            going.clear()
    sys.setswitchinterval(1e-6)
    try:
        run_all(compute, copy)
    finally:
        sys.setswitchinterval(interval)
