"""Chains as values: checked wherever they are used, each with a text of its own; names of numbers; hash, copies."""
import copy
from dataclasses import fields, replace
from math import inf, isinf, nan
from pathlib import Path
import pickle
from random import Random
from types import SimpleNamespace

import numpy as np
from oracles.two_rods import rod, TWO_RODS
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import chain_from_dict, ChainError
from planar_chain_sim.chain_file import chain_from_text
from planar_chain_sim.mechanics.plan import plan_of
from planar_chain_sim.resimulation import command_line as resimulation

CONFIGS = ('arczewski_example', 'cart_arm_telescope', 'double_pendulum', 'four_link_robot', 'seven_link_arm')
CHAINS = [pcs.load_chain(f'{name}.yaml') for name in CONFIGS]
TWO = chain_from_text(TWO_RODS)
DOORS = {
    'Simulation': pcs.Simulation,
    'rollout': lambda chain: pcs.rollout(chain, 0.01),
    'rollout_batch': lambda chain: pcs.rollout_batch([chain, TWO], duration=0.01),
    'forward_dynamics': lambda chain: pcs.forward_dynamics(chain, *np.zeros((3, 3))),
    'reference': lambda chain: pcs.forward_dynamics(chain, *np.zeros((3, 3)), form='reference'),
    'inverse_dynamics': lambda chain: pcs.inverse_dynamics(chain, *np.zeros((3, 3))),
    'mass_matrix': lambda chain: pcs.mass_matrix(chain, np.zeros(3)),
    'energy': lambda chain: pcs.energy(chain, *np.zeros((2, 3))),
    'linearize': lambda chain: pcs.linearize(chain, *np.zeros((3, 3))),
    'equations': pcs.equations,
    'urdf_of': pcs.urdf_of,
    'replace_chain': lambda chain: pcs.Simulation(TWO).replace_chain(chain),
    'body_poses': lambda chain: pcs.body_poses(chain, np.zeros(3)),
    'body_velocities': lambda chain: pcs.body_velocities(chain, *np.zeros((2, 3))),
    'center_of_mass': lambda chain: pcs.center_of_mass(chain, np.zeros(3)),
    'momentum': lambda chain: pcs.momentum(chain, *np.zeros((2, 3))),
    'jacobian': lambda chain: pcs.jacobian(chain, np.zeros(3), 'forearm'),
    'reaction_forces': lambda chain: pcs.reaction_forces(chain, *np.zeros((3, 3))),
}


def random_chain(random):
    """Return a chain of random numbers, every key given somewhere, inertias either way."""
    bodies, joints = [], 0
    for k in range(random.randint(1, 5)):
        center, mass = [random.gauss(0, 0.4), random.gauss(0, 0.4)], random.uniform(0.1, 4.0)
        about_center = random.uniform(0.01, 1.0)
        body = {'name': f'b{k}', 'carrier': f'b{random.randrange(k)}' if k else 'base', 'mass': mass,
                'center_of_mass': center, 'angle': random.gauss(0, 1), 'origin': [random.gauss(0, 1), 0.0]}
        if random.random() < 0.5:
            body['inertia'] = about_center + mass * (center[0]**2 + center[1]**2)
        else:
            body['inertia_com'] = about_center
        for kind in ('slide', 'rotation'):
            if kind == 'rotation' or random.random() < 0.3:
                axis = random.gauss(0, 1) if kind == 'slide' else random.choice((1, -1))
                joint = {'joint': f'j{joints}', 'axis': axis}
                for key in ('damping', 'stiffness', 'friction', 'armature', 'effort_limit'):
                    if random.random() < 0.4:
                        joint[key] = random.uniform(0.0, 3.0)
                for key in ('rest', 'velocity'):
                    if random.random() < 0.4:
                        joint[key] = random.gauss(0, 1)
                if random.random() < 0.3:
                    joint.update(lower=random.choice((-2.0, -inf)), upper=random.choice((2.0, inf)),
                                 position=random.uniform(-1, 1), restitution=random.random())
                body[kind], joints = joint, joints + 1
        bodies.append(body)
    return chain_from_dict({'name': 'random', 'gravity': [random.gauss(0, 1), -9.81], 'bodies': bodies})


def same_bits(one, other):
    return repr(one) == repr(other)


def with_body(chain, index, /, **changes):
    bodies = list(chain.bodies)
    bodies[index] = replace(bodies[index], **changes)
    return replace(chain, bodies=tuple(bodies))


def with_joint(chain, index, kind, /, **changes):
    return with_body(chain, index, **{kind: replace(getattr(chain.bodies[index], kind), **changes)})


WRONG = [
    ('negative mass', with_body(TWO, 1, mass=-3)),
    ('no number', with_body(TWO, 1, mass='heavy')),
    ('nan', with_body(TWO, 0, mass=nan)),
    ('mass alone', with_body(TWO, 1, mass=2.5)),
    ('mass centre alone', with_body(TWO, 1, center_of_mass=0.1 + 0j)),
    ('inertia alone', with_body(TWO, 0, inertia=1.0)),
    ('inertia_com alone', with_body(TWO, 0, inertia_com=1.0)),
    ('a list for a vector', with_body(TWO, 0, origin=[0.0, 1.0])),
    ('infinite angle', with_body(TWO, 0, angle=inf)),
    ('carrier that comes later', with_body(TWO, 0, carrier=1)),
    ('carrier that is not there', with_body(TWO, 1, carrier=-2)),
    ('name of another', with_body(TWO, 1, name='upper')),
    ('empty name', with_body(TWO, 1, name='')),
    ('negative damping', with_joint(TWO, 0, 'rotation', damping=-1.0)),
    ('axis', with_joint(TWO, 0, 'rotation', axis=2.0)),
    ('lower above upper', with_joint(TWO, 0, 'rotation', lower=1.0, upper=-1.0)),
    ('beyond a stop', with_joint(TWO, 1, 'rotation', upper=1.0, position=2.0)),
    ('restitution', with_joint(TWO, 1, 'rotation', restitution=1.5)),
    ('joint of another name', with_joint(TWO, 1, 'rotation', name='shoulder')),
    ('a slide that turns', with_body(TWO, 1, slide=TWO.bodies[1].rotation, rotation=None)),
    ('no joint', with_body(TWO, 0, rotation=3)),
    ('singular', replace(TWO, bodies=tuple(
        replace(body, mass=0.0, center_of_mass=0j, inertia=0.0, inertia_com=0.0) for body in TWO.bodies))),
    ('gravity', replace(TWO, gravity=complex(nan, 0.0))),
    ('gravity of words', replace(TWO, gravity='down')),
    ('no bodies', replace(TWO, bodies=())),
    ('bodies of another kind', replace(TWO, bodies=(1, 2))),
]


@pytest.mark.parametrize('door', DOORS)
@pytest.mark.parametrize(('what', 'chain'), WRONG, ids=[what for what, _ in WRONG])
def test_chain_made_by_hand_that_cannot_be_is_one_sentence_at_every_door(what, chain, door):
    for _ in range(2):   # and not taken the second time
        with pytest.raises(ChainError) as caught:
            DOORS[door](chain)
        assert str(caught.value).isprintable() and 'must' in str(caught.value)


@pytest.mark.parametrize('door', DOORS)
@pytest.mark.parametrize('given, call', [
    ('double_pendulum.yaml', "load_chain('double_pendulum.yaml')"),
    (Path('arm.urdf'), "load_chain('arm.urdf')"), ({'bodies': []}, 'chain_from_dict(data)'), (None, 'load_chain(file)'),
    (3, 'load_chain(file)'), (SimpleNamespace(joint_count=3), 'load_chain(file)')])
def test_what_is_no_chain_is_refused_with_the_call_that_makes_one(door, given, call):
    with pytest.raises(TypeError) as caught:
        DOORS[door](given)
    assert str(caught.value) == f'chain is {given!r}, must be a Chain: {call} gives one'


def test_sentence_names_the_body_and_what_to_do():
    with pytest.raises(ChainError, match=r"body 'forearm' key 'mass' is -3, must be a number >= 0 \(kg\)$"):
        pcs.Simulation(with_body(TWO, 1, mass=-3))
    with pytest.raises(ChainError, match=r"^body 'forearm' has the inertia .*with_parameters keeps them consistent$"):
        pcs.Simulation(with_body(TWO, 1, mass=1.5))


def test_random_damage_is_a_sentence_or_a_chain_that_says_itself():
    random, taken, refused = Random(15), 0, 0
    odd = [nan, inf, -inf, -1.0, 0.0, 1e308, 'x', None, 3 + 0j, [1.0], np.float64(0.5), True, 10**400]
    for _ in range(600):
        chain = random_chain(random)
        index = random.randrange(len(chain.bodies))
        body = chain.bodies[index]
        joints = [kind for kind in ('slide', 'rotation') if getattr(body, kind)]
        if joints and random.random() < 0.6:
            kind = random.choice(joints)
            name = random.choice(fields(body.rotation or body.slide)).name
            damaged = with_joint(chain, index, kind, **{name: random.choice(odd)})
        else:
            damaged = with_body(chain, index, **{random.choice(fields(body)).name: random.choice(odd)})
        try:
            simulation = pcs.Simulation(damaged)
        except ChainError as error:
            refused += 1
            assert str(error).isprintable() and len(str(error)) < 500
            continue
        taken += 1
        assert chain_from_text(simulation.chain.source) == damaged
    assert taken > 50 and refused > 200


def test_text_is_the_chain_s_own_whatever_it_was_made_with():
    for random in map(Random, range(200)):
        chain = random_chain(random)
        assert chain.source.startswith('name: random')
        for changed in (replace(chain, gravity=-1.62j), replace(chain, source=TWO_RODS), replace(chain, source='a: ['),
                        pcs.Chain('random', chain.gravity, chain.bodies, TWO_RODS), replace(chain, name='other'),
                        pcs.Chain('random', chain.gravity, chain.bodies), replace(chain, source='')):
            assert same_bits(chain_from_text(changed.source), changed)
        assert replace(chain).source == chain.source    # a text of the same chain is kept unchanged
    commented = chain_from_text('# a comment\n' + TWO_RODS)
    assert replace(commented, gravity=TWO.gravity).source == commented.source
    assert '#' not in replace(commented, gravity=-1j).source


def test_log_of_a_chain_made_by_hand_is_computed_again_bit_for_bit(tmp_path, capsys):
    """A text that says something else, a payload and a wrench from before the log begins."""
    moon = replace(CHAINS[3], gravity=-1.62j)
    simulation = pcs.Simulation(pcs.Chain(moon.name, moon.gravity, moon.bodies, CHAINS[3].source))
    simulation.attach('forearm', 0.7, (0.2, 0.1))
    simulation.set_wrench('column', (1.0, -2.0), 0.3, 'world')
    with pcs.OfflineLog(tmp_path / 'run.mcap', simulation) as log:
        log.advance(200)
    assert resimulation.main([str(tmp_path / 'run.mcap')]) == 0
    assert 'equal: 201 states' in capsys.readouterr().out


def test_every_field_of_a_joint_and_a_body_is_written_back():
    for random in map(Random, range(300)):
        chain = random_chain(random)
        bare = pcs.Chain(chain.name, chain.gravity, chain.bodies)
        again = chain_from_text(bare.source)
        assert same_bits(again, chain)
        assert [body.given for body in again.bodies] == [body.given for body in chain.bodies]
    numbers = {'damping': 0.1, 'stiffness': 2.0, 'rest': -0.0, 'friction': 0.3, 'preload': -0.8, 'armature': 0.4,
               'effort_limit': inf, 'lower': -inf, 'upper': inf, 'restitution': 0.5, 'position': 0.6, 'velocity': -0.7}
    assert set(numbers) | {'name', 'kind', 'axis'} == {entry.name for entry in fields(pcs.Joint)}
    body, = chain_from_dict({'bodies': [rod(rotation={'joint': 'pivot', 'axis': -1.0, **numbers})]}).bodies
    assert repr(body.rotation) == repr(pcs.Joint('pivot', 'rotation', -1.0, **numbers))


BODY_NAMES = ('mass', 'center_of_mass.x', 'center_of_mass.y', 'inertia', 'inertia_com', 'origin.x', 'origin.y', 'angle')
JOINT_NAMES = ('damping', 'stiffness', 'rest', 'friction', 'preload', 'armature', 'effort_limit', 'lower', 'upper',
               'position', 'velocity')


def test_parameters_are_the_numbers_by_name():
    wanted = {'gravity.x', 'gravity.y', *(f'{body}.{key}' for body in ('upper', 'forearm') for key in BODY_NAMES),
              *(f'{joint}.{key}' for joint in ('shoulder', 'boom', 'elbow') for key in JOINT_NAMES)}
    assert set(TWO.parameters) == wanted
    assert all(type(value) is float for value in TWO.parameters.values())
    picked = ('gravity.y', 'forearm.mass', 'forearm.center_of_mass.y', 'forearm.inertia', 'forearm.inertia_com',
              'elbow.lower', 'elbow.effort_limit')
    assert [TWO.parameters[name] for name in picked] == [-9.81, 2.0, 0.4, 0.6, 0.1, -inf, inf]


def test_all_parameters_put_back_are_the_same_chain():
    for random in map(Random, range(300)):
        chain = random_chain(random)
        again = chain.with_parameters(chain.parameters)
        assert same_bits(again, chain) and same_bits(chain_from_text(again.source), chain)


@pytest.mark.slow
def test_each_parameter_alone_can_be_varied_and_nothing_else_changes():
    random, changed = Random(7), 0
    for _ in range(25):
        chain = random_chain(random)
        for name, value in chain.parameters.items():
            new = 0.5 if isinf(value) and value > 0 else -3.0 if isinf(value) else value * 1.001 + 1e-3
            if name.endswith('.upper'):
                new = 3.0
            try:
                varied = chain.with_parameters({name: new})
            except ChainError as error:   # a heavier or shorter body whose inertia does not suffice, a stop
                assert name.rpartition('.')[2] in (*BODY_NAMES, 'x', 'y', 'lower', 'position'), error
                continue
            changed += 1
            now = varied.parameters
            moved = {key for key, old in chain.parameters.items() if now[key] != old}
            owner, _, key = name.partition('.')
            companions = {f'{owner}.inertia', f'{owner}.inertia_com'} if key in BODY_NAMES[:5] else set()
            assert now[name] == new and {name} <= moved <= {name} | companions, (name, moved)
            assert same_bits(chain_from_text(varied.source), varied)
    assert changed > 1000


@pytest.mark.parametrize(('given', 'kept'), [({'inertia': 2.0}, 'inertia'),
                                             ({'inertia': None, 'inertia_com': 2.0}, 'inertia_com')])
def test_heavier_body_keeps_the_inertia_that_its_file_gives(given, kept):
    chain = chain_from_dict({'bodies': [rod(center_of_mass=[0.5, 0.0], **given)]})
    for changed in (chain, replace(chain, gravity=-1j), pickle.loads(pickle.dumps(chain))):
        varied = changed.with_parameters({'rod.mass': 2.0}).bodies[0]
        assert getattr(varied, kept) == 2.0 and varied.inertia == varied.inertia_com + 0.5
        assert varied.given == kept
    varied = chain.with_parameters({'rod.mass': 2.0, 'rod.inertia_com': 1.0}).bodies[0]
    assert (varied.inertia, varied.inertia_com, varied.given) == (1.5, 1.0, 'inertia_com')


def test_name_of_a_body_and_of_a_joint_needs_a_prefix():
    chain = chain_from_dict({'bodies': [rod(rotation={'joint': 'rod'}),
                                        rod(name='tip', carrier='rod', rotation={'joint': 'joint:rod'})]})
    names = chain.parameters
    assert {'body:rod.mass', 'joint:rod.damping', 'tip.mass', 'joint:joint:rod.damping'} <= set(names)
    assert not {'rod.mass', 'rod.damping'} & set(names)
    assert chain.with_parameters({'joint:rod.damping': 2.0}).joints[0].damping == 2.0
    with pytest.raises(ChainError, match=r"'rod.mass' is not one of .* \(did you mean 'body:rod.mass'\?\)"):
        chain.with_parameters({'rod.mass': 1.0})


@pytest.mark.parametrize(('values', 'sentence'), [
    ({'forearm.mas': 1.0}, "parameter 'forearm.mas' is not one of two_rods (did you mean 'forearm.mass'?), must be one "
     'of Chain.parameters'),
    ({3: 1.0}, 'parameter 3 is not one of two_rods, must be one of Chain.parameters'),
    ({'elbow.damping': 'x'}, "parameter 'elbow.damping' is 'x', must be a number"),
    ({'elbow.damping': True}, "parameter 'elbow.damping' is true, must be a number"),
    ({'elbow.damping': -1.0},
     "bodies[1].rotation.damping: body 'forearm' key 'rotation.damping' is -1.0, must be a number >= 0 (N m s/rad)"),
    ({'gravity.x': nan}, "gravity: key 'gravity' is [nan, -9.81], must be a list of two finite numbers [x, y] (m/s^2)"),
    ({'upper.mass': 2.0}, "bodies[0].inertia: body 'upper' key 'inertia' is 0.4, must be at least mass * "
     "|center_of_mass|^2 = 0.5 (kg m^2 about the joint point; about the mass centre the key is 'inertia_com')"),
    ({'upper.inertia': 1.0, 'upper.inertia_com': 0.9}, "parameters 'upper.inertia' and '.inertia_com' are 1.0 and 0.9, "
     'must differ by mass * |center_of_mass|^2 = 0.25, or be one of the two'),
    ([('upper.mass', 2.0)], 'the parameters are of type list, must be a mapping of names to numbers'),
])
def test_parameters_that_cannot_be_are_one_exact_sentence(values, sentence):
    with pytest.raises(ChainError) as caught:
        TWO.with_parameters(values)
    assert str(caught.value) == sentence


def test_a_varied_chain_moves_like_one_whose_file_says_so():
    """Twin: the number written into the text."""
    text = TWO_RODS.replace('mass: 2.0', 'mass: 2.5').replace('axis: 1\n', 'axis: 1\n      damping: 0.3\n')
    wanted, state = chain_from_text(text), ([0.3, 0.2, -0.5], [1.0, -0.4, 2.0], [0.1, 0.2, 0.3])
    varied = TWO.with_parameters({'forearm.mass': 2.5, 'shoulder.damping': np.float64(0.3)})
    assert varied == wanted != TWO
    assert pcs.forward_dynamics(varied, *state).tobytes() == pcs.forward_dynamics(wanted, *state).tobytes()


@pytest.mark.parametrize('chain', CHAINS, ids=CONFIGS)
def test_hash_equality_pickle_and_copies(chain):
    again = chain_from_text(chain.source)
    assert again == chain and hash(again) == hash(chain) and {chain: 1}[again] == 1
    other = chain.with_parameters({'gravity.x': 1.0})
    assert other != chain and len({chain, again, other}) == 2
    pcs.Simulation(chain)      # what is kept with a chain for use must not travel
    for copied in (pickle.loads(pickle.dumps(chain)), copy.copy(chain), copy.deepcopy(chain)):
        assert copied == chain and hash(copied) == hash(chain) and copied.source == chain.source
        assert pcs.Simulation(copied).chain is copied
        with pytest.raises(ChainError):
            pcs.Simulation(with_body(copied, 0, mass=-1.0))
    bad = pickle.loads(pickle.dumps(with_body(chain, 0, mass=-1.0)))
    with pytest.raises(ChainError):
        pcs.Simulation(bad)


def test_repr_is_one_or_two_useful_lines():
    """What a notebook shows: names and numbers of the thing, not its arrays and coefficients."""
    chain, long = pcs.load_chain('four_link_robot.yaml'), pcs.load_chain('chain_32_links.yaml')
    simulation = pcs.Simulation(chain)
    simulation.advance(5)
    equations = pcs.equations(chain)
    shown = {
        'Simulation of four_link_robot at tick 5, t = 0.005 s: 5 joints, method taylor, tick 0.001 s': simulation,
        'Checkpoint of four_link_robot at tick 5, method taylor': simulation.checkpoint(),
        'Run: 20 ticks of 0.001 s, 5 joints, to t = 0.02 s': pcs.rollout(chain, 0.02),
        'Run: 0 ticks, 5 joints, to t = 0 s': pcs.rollout(chain, 0.0),
        'BatchRun: 3 scenes, 5 joints, to t = 0.02 s, 21 states each; none failed': pcs.rollout_batch(
            chain, position=3 * [simulation.position], duration=0.02),
        'BatchRun: 1 scene, 5 joints, to t = 0.02 s, the last state alone; none failed': pcs.rollout_batch(
            chain, duration=0.02, every_tick=False),
        'METHODS: semi_implicit_euler, rk4, ': pcs.METHODS,
        'Method rk4: explicit Runge-Kutta, order 4, fixed step': pcs.METHODS['rk4'],
        'Method taylor: taylor, order by the tolerance, adaptive': pcs.METHODS['taylor'],
        'Equations of four_link_robot in absolute coordinates: phi1 (column_joint), phi2': equations,
        'Equations of chain_32_links in joint coordinates: q1 (': pcs.equations(long, 'joint'),
        'Equation of x1, column_slide, (5.88): ': equations['column_slide'],
        f"Term '{equations[0].terms[0]}': acceleration, left side of phi1": equations[0].terms[0],
        'Plan: 4 links, 5 joints; uses slides, ': plan_of(chain),
    }
    for begin, value in shown.items():
        assert repr(value).startswith(begin), repr(value)
        assert len(repr(value)) < 320 and repr(value).count('\n') < 2
    assert dict(pcs.METHODS) == pcs.METHODS and list(pcs.METHODS)[1] == 'rk4'


def test_parameters_are_read_only_and_bodies_of_a_list_are_a_tuple():
    with pytest.raises(TypeError):
        TWO.parameters['gravity.y'] = 0.0
    again = replace(TWO, bodies=list(TWO.bodies))
    assert again == TWO and hash(again) == hash(TWO) and isinstance(again.bodies, tuple)
    with pytest.raises(ChainError, match='too large, must be a number below'):
        TWO.with_parameters({'gravity.y': 10**400})


@pytest.mark.parametrize('odd', [
    ['1', '2', '3'], [b'1', b'2', b'3'], np.array(['1', '2', 3], dtype=object), [10**400, 0, 0], [1j, 0, 0],
    np.zeros(3, 'datetime64[s]'), np.zeros(3, 'timedelta64[s]'), np.zeros(3, [('a', float)])])
def test_what_is_no_number_is_no_position(odd):
    with pytest.raises(ValueError, match=r'^position must be numbers of shape'):
        pcs.body_poses(TWO, odd)
