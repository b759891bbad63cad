"""The chain files of the package: where they are found, and that each is what its header says."""
from pathlib import Path
import site
import sys

import numpy as np
import pytest

import planar_chain_sim
from planar_chain_sim import ChainError, energy, forward_dynamics, load_chain, mass_matrix, Simulation
from planar_chain_sim.chain.joint_arrays import initial_state
from planar_chain_sim.chain_file import find_chain_file

CONFIG = Path(__file__).parents[2] / 'config'
NAMES = ('arczewski_example', 'cart_arm_telescope', 'chain_32_links', 'double_pendulum', 'four_link_robot',
         'seven_link_arm')


def test_config_holds_these_chains_and_no_others():
    assert tuple(sorted(path.stem for path in CONFIG.iterdir())) == NAMES


@pytest.mark.parametrize('name', NAMES)
def test_chain_loads_under_its_own_name_and_moves(name):
    chain = load_chain(CONFIG / f'{name}.yaml')
    assert chain.name == name
    assert chain.source == (CONFIG / f'{name}.yaml').read_text()
    start, _ = initial_state(chain)
    simulation = Simulation(chain)
    simulation.advance(100)
    assert np.abs(simulation.position - start).max() > 1e-3


def test_arczewski_example_is_case_a():
    """Oracle: 20 digits, derived symbolically; 1e-14 is 45 roundings of the largest acceleration."""
    chain = load_chain(CONFIG / 'arczewski_example.yaml')
    assert chain.joint_names == ('column_slide', 'column_joint', 'upper_arm_joint', 'forearm_joint', 'side_arm_joint')
    phi = [-1.6885418081546309732, -1.5673906215470620974, -0.54634404870092430565, 0.42528308014579388658]
    expected = np.array([-7.7386320113188676997, phi[0], phi[1] - phi[0], phi[2] - phi[1], phi[3] - phi[1]])
    position, velocity = initial_state(chain)
    acceleration = forward_dynamics(chain, position, velocity, np.array([2.5, 1.0, -0.5, 0.3, 0.2]))
    assert np.abs(acceleration - expected).max() < 1e-14 * np.abs(expected).max()
    kinetic, potential = energy(chain, position, velocity)
    assert kinetic == pytest.approx(1.3904645658410369045, rel=1e-14, abs=0)
    assert potential == pytest.approx(20.981808434654299181, rel=1e-14, abs=0)


def test_four_link_robot_is_the_example_and_swings_and_settles():
    """Oracle: at rest the spring carries 5.3 kg * 9.81 m/s^2 at 0.25 m and every link hangs straight down."""
    robot, example = (load_chain(CONFIG / f'{name}.yaml') for name in ('four_link_robot', 'arczewski_example'))
    for body, twin in zip(robot.bodies, example.bodies):
        assert (body.name, body.carrier, body.origin) == (twin.name, twin.carrier, twin.origin)
        assert (body.mass, body.center_of_mass, body.inertia) == (twin.mass, twin.center_of_mass, twin.inertia)
    assert robot.joint_names == example.joint_names
    assert all(joint.damping > 0 for joint in robot.joints)
    simulation = Simulation(robot)
    simulation.advance(1500)
    assert simulation.position[1] < -np.pi / 2 - 0.5   # it swings through
    simulation.advance(58500)
    assert np.abs(simulation.velocity).max() < 0.02
    assert simulation.position == pytest.approx([0.25, -np.pi / 2, 0.0, 0.0, 0.0], abs=0.01)


def test_double_pendulum_starts_where_its_header_says():
    """Oracle: two uniform rods of 1 m and 1 kg at 2.0 and 2.5 rad from straight down, V = -g sum m h."""
    chain = load_chain(CONFIG / 'double_pendulum.yaml')
    position, velocity = initial_state(chain)
    height = 1.5 * np.cos(2.0) + 0.5 * np.cos(2.5)
    assert energy(chain, position, velocity) == (0.0, pytest.approx(-9.81 * height, rel=1e-14, abs=0))
    inertia_first, inertia_second = 1 / 3 + 1.0, 1 / 3
    coupling = 0.5 * np.cos(0.5)
    expected = [[inertia_first + inertia_second + 2 * coupling, inertia_second + coupling],
                [inertia_second + coupling, inertia_second]]
    assert mass_matrix(chain, position) == pytest.approx(np.array(expected), rel=1e-14, abs=0)


@pytest.mark.parametrize(('name', 'links'), [('seven_link_arm', 7), ('chain_32_links', 32)])
def test_rods_end_to_end_are_one_rod(name, links):
    """Oracle: straight, they turn as one rod of 1 m and 1 kg, 1/3 kg m^2; the last alone has (1/n)^3 / 3."""
    chain = load_chain(CONFIG / f'{name}.yaml')
    inertia = mass_matrix(chain, np.zeros(links))
    assert inertia[0, 0] == pytest.approx(1 / 3, rel=1e-14, abs=0)
    assert inertia[-1, -1] == pytest.approx(1 / (3 * links**3), rel=1e-14, abs=0)


def test_cart_arm_telescope_has_every_kind_of_body():
    chain = load_chain(CONFIG / 'cart_arm_telescope.yaml')
    kinds = {body.name: (body.slide is not None, body.rotation is not None) for body in chain.bodies}
    assert kinds == {'cart': (True, False), 'arm': (False, True), 'motor': (False, False), 'telescope': (True, False),
                     'gripper': (True, True)}


@pytest.fixture
def empty_places(tmp_path, monkeypatch):
    """Make the working directory, the ament index and sys.prefix three empty folders."""
    for folder in ('here', 'ament', 'prefix'):
        (tmp_path / folder).mkdir()
    monkeypatch.chdir(tmp_path / 'here')
    monkeypatch.setenv('AMENT_PREFIX_PATH', f'/no/such/folder:{tmp_path / "ament"}')
    monkeypatch.setattr(sys, 'prefix', str(tmp_path / 'prefix'))
    monkeypatch.setattr(site, 'ENABLE_USER_SITE', False)
    return tmp_path


def put(folder, name='four_link_robot.yaml'):
    """Put a chain file into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_text((CONFIG / 'double_pendulum.yaml').read_text())
    return folder / name


@pytest.mark.parametrize('path', ['four_link_robot.yaml', 'config/four_link_robot.yaml'])
def test_relative_chain_file_is_found_in_the_first_of_its_places(empty_places, path):
    share = 'share/planar_chain_sim/config'
    source = Path(planar_chain_sim.__file__).resolve().parents[1] / 'config/four_link_robot.yaml'
    if source.exists():   # not so for an installed package
        assert find_chain_file(path) == source
    in_prefix = put(empty_places / 'prefix' / share)
    assert find_chain_file(path) == in_prefix
    in_ament = put(empty_places / 'ament' / share)
    assert find_chain_file(path) == in_prefix   # no marker, no ament package
    marker = empty_places / 'ament/share/ament_index/resource_index/packages/planar_chain_sim'
    marker.parent.mkdir(parents=True)
    marker.touch()
    assert find_chain_file(path) == in_ament
    put(empty_places / 'here' / Path(path).parent)
    assert find_chain_file(path) == Path(path)
    assert load_chain(path).name == 'double_pendulum'


def test_a_chain_of_a_user_s_own_installation_is_found(empty_places, monkeypatch):
    in_user = put(empty_places / 'user/share/planar_chain_sim/config', 'chain_of_user.yaml')
    with pytest.raises(ChainError, match='was not found'):
        find_chain_file('chain_of_user.yaml')
    monkeypatch.setattr(site, 'ENABLE_USER_SITE', True)
    monkeypatch.setattr(site, 'USER_BASE', str(empty_places / 'user'))
    assert find_chain_file('chain_of_user.yaml') == in_user


def test_absolute_chain_file_stays_and_an_unknown_one_is_one_sentence(empty_places):
    assert find_chain_file('/no/such.yaml') == Path('/no/such.yaml')
    with pytest.raises(ChainError) as caught:
        find_chain_file('no/such.yaml')
    prefix = empty_places / 'prefix/share/planar_chain_sim/config'
    source = Path(planar_chain_sim.__file__).resolve().parents[1] / 'config'
    assert str(caught.value) == (f'no/such.yaml: was not found in the working directory, {prefix}, {source}, '
                                 'must be a chain file in YAML; the package has '
                                 + (', '.join(sorted(path.name for path in source.glob('*.yaml'))) or 'none'))
