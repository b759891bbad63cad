"""Every event, logged or published, has the data of its row in EVENTS; the encoders agree; the docs have the table."""
import json
from pathlib import Path
from random import Random

import numpy as np
from oracles.random_trees import random_state, random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import _kernel
from planar_chain_sim.recording.cdr import decode_string, encode_float64_multi_array
from planar_chain_sim.recording.events import decode_event, encode_command, encode_event, EVENTS, table
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.resimulation.bits import resimulate

DOCS = Path(__file__).resolve().parents[2] / 'docs'


def test_the_docs_have_the_table_as_it_is():
    pages = [page.read_text() for page in DOCS.rglob('*.md')]
    assert sum(table() in page for page in pages) == 1, 'print it by `python -m planar_chain_sim.recording.events`'
    for name, kind in EVENTS.items():
        assert f'| `{name}` |' in table() and kind.meaning.endswith('.') and '|' not in kind.meaning


def test_events_of_joints_are_those_of_the_kernel():
    assert set(_kernel.EVENT_KINDS) == {name for name, kind in EVENTS.items() if 'speed' in kind.keys}


def test_an_event_with_other_data_is_refused():
    for kind, row in EVENTS.items():
        data = {key: 0 for key in row.keys}
        assert json.loads(decode_string(encode_event(3, kind, data))) == {'tick': 3, 'kind': kind, 'data': data}
        with pytest.raises(ValueError, match=f"the event '{kind}' has the data"):
            encode_event(3, kind, {**data, 'more': 1})
        if row.keys:
            with pytest.raises(ValueError, match=f'must have {", ".join(row.keys)}'):
                encode_event(3, kind, {key: 0 for key in row.keys[1:]})


def test_the_quick_encoders_of_commands_say_the_same():
    """Python's for any command and the kernel's for the usual one, on efforts of all sizes."""
    rng = np.random.default_rng(3)
    for tick in (0, 7, 2**40):
        for _ in range(200):
            effort = rng.normal(size=rng.integers(1, 9)) * 10.0**rng.integers(-300, 300)
            effort[rng.random(effort.size) < 0.2] = rng.choice([0.0, -0.0, 1.0, 1e22, 5e-324, 100.0])
            usual = encode_event(tick, 'command', {'topic': '/arm/commands', 'effort': effort.tolist()})
            quick = encode_command(tick, '/arm/commands', effort)
            told = decode_event(quick)
            assert told == decode_event(usual) and list(told['data']) == list(EVENTS['command'].keys)
            assert np.array(told['data']['effort']).tobytes() == effort.tobytes()
            message = bytes(encode_float64_multi_array(effort))
            assert _kernel.plain_command(message, np.zeros(effort.size), tick, '/arm/commands') == quick


def random_change(random, chain):
    """Return kind and data of a change that can be."""
    joints, numbers = chain.joint_count, lambda count: [random.uniform(-1.0, 1.0) for _ in range(count)]
    body = random.choice(chain.bodies).name
    kind = random.choice(['reset', 'state', 'parameter', 'wrench', 'payload'])
    data = {'reset': {}, 'state': {'position': numbers(joints), 'velocity': np.array(numbers(joints))},
            'wrench': {'body': body, 'force': numbers(2), 'moment': random.gauss(0.0, 1.0)},
            'payload': {'name': 'load', 'body': body, 'mass': random.choice([0.0, 0.5]), 'position': (0.1, 0.0)},
            'parameter': random.choice([{'name': 'gravity', 'value': numbers(2)}, {'name': 'effort_limit', 'value': [
                random.choice([np.inf, 1.0]) for _ in range(joints)]}])}[kind]
    return kind, data


@pytest.mark.parametrize('seed', range(30))
def test_every_event_of_a_random_run_has_the_keys_of_its_row(tmp_path, seed):
    """Random trees, efforts and changes; the log runs again, bit for bit."""
    random, rng = Random(seed), np.random.default_rng(seed)
    chain = random_tree(seed, 1 + seed % 5)
    simulation = pcs.Simulation(chain, random.choice(['auto', 'rk4', 'semi_implicit_euler']))
    simulation.set_state(*random_state(chain, seed)[:2])
    path = tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation, random.choice(['none', 'zstd'])) as log:
        for _ in range(12):
            kind, data = random_change(random, chain)
            log.change(kind, **data)
            effort = random.choice([None, rng.normal(size=chain.joint_count),
                                    rng.normal(size=(20, chain.joint_count))])
            log.advance(20, effort)
    read = pcs.load_log(path)
    assert {event['kind'] for event in read.events} - {'command'}
    for event in read.events:
        assert tuple(event['data']) == EVENTS[event['kind']].keys
    assert resimulate(read_log(path)).difference is None


@pytest.mark.parametrize('method, kind, rod, bob', [
    ('rk4', 'divergence', {'mass': 1.0, 'inertia': 1.0}, {'stiffness': 1e8, 'position': 1.0}),
    ('auto', 'stopped', {'mass': 0.0, 'inertia': 0.0}, {})])   # with the bob stretched out the rod has no inertia
@pytest.mark.filterwarnings('ignore:step is')
def test_the_end_of_a_motion_has_the_keys_of_its_row(tmp_path, method, kind, rod, bob):
    chain = pcs.chain_from_dict({'name': 'two', 'gravity': [0.0, 0.0], 'bodies': [
        {'name': 'rod', 'carrier': 'base', **rod, 'rotation': {'joint': 'first'}},
        {'name': 'bob', 'carrier': 'rod', 'origin': [1.0, 0.0], 'mass': 1.0, 'center_of_mass': [1.0, 0.0],
         'inertia': 1.0, 'rotation': {'joint': 'second', **bob}}]})
    path = tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, pcs.Simulation(chain, method)) as log, pytest.raises(pcs.SimulationError):
        log.advance(1000)
    assert pcs.load_log(path).events[-1]['kind'] == kind
    assert tuple(pcs.load_log(path).events[-1]['data']) == EVENTS[kind].keys
    assert resimulate(read_log(path)).difference is None


def test_joint_events_of_an_offline_run_have_the_keys_of_their_rows(tmp_path):
    chain = pcs.chain_from_dict({'name': 'hammer', 'bodies': [
        {'name': 'boom', 'carrier': 'base', 'mass': 1.0, 'center_of_mass': [0.5, 0.0], 'inertia_com': 0.1,
         'rotation': {'joint': 'luff', 'friction': 1.0, 'lower': -0.5, 'upper': 0.5}}]})
    simulation, path = pcs.Simulation(chain), tmp_path / 'run.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(10, [4.905])
        log.advance(1500)
        log.advance(200, [20.0])
        log.change('state', position=[0.0], velocity=[0.1])
        log.advance(300, [4.905])
    events = pcs.load_log(path).events
    assert {event['kind'] for event in events} >= {'stop_touched', 'stop_left', 'slipped', 'stuck'}
    for event in events:
        assert tuple(event['data']) == EVENTS[event['kind']].keys


@pytest.mark.parametrize('data', [b'', b'\0\1\0\0', encode_event(1, 'pause', {})[:-1]])
def test_what_is_no_event_is_refused(data):
    with pytest.raises(ValueError):
        decode_event(data)
