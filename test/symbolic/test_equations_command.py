"""The equations executable: what it prints, draws and refuses."""
import json
import re
import subprocess
import sys

import numpy as np
from printed import from_latex, from_text
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.symbolic.command_line import main
from planar_chain_sim.symbolic.contributions import contributions


def printed(capsys, *arguments):
    """Return what the command prints for arguments it takes."""
    assert main(list(arguments)) == 0
    out, err = capsys.readouterr()
    assert err == ''
    return out


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    """Return a log of the four-link robot over half a second under a held effort."""
    simulation = pcs.Simulation(pcs.load_chain('four_link_robot.yaml'))
    path = tmp_path_factory.mktemp('log') / 'swing.mcap'
    with pcs.OfflineLog(path, simulation) as log:
        log.advance(500, [3.0, 1.0, 0.5, 0.0, -0.2])
    return path


def test_equations_of_a_chain_are_printed_in_full(capsys):
    text = printed(capsys, 'four_link_robot.yaml')
    for heading in ('Bodies', 'Topology', 'M = P m P', 'Unit vectors'):
        assert f'\n{heading}' in text or f'   {heading}' in text
    assert list(from_text(text)) == ['phi1', 'phi2', 'phi3', 'phi4', 'x1']
    assert from_text(text)['phi3'][1] == 'm3*c3*g_vec @ u3_hat - d3*(phi3_d - phi2_d) + tau3'


@pytest.mark.parametrize('name', ['x1', 'column_slide'])
def test_one_coordinate_alone(name, capsys):
    text = printed(capsys, 'four_link_robot.yaml', '--coordinate', name)
    assert list(from_text(text)) == ['x1'] and 'Topology' not in text
    latex = printed(capsys, 'four_link_robot.yaml', '--coordinate', name, '--format', 'latex')
    assert from_latex(latex) == from_text(text) and 'array' not in latex
    data = json.loads(printed(capsys, 'four_link_robot.yaml', '--coordinate', name, '--format', 'json'))
    assert [equation['joint'] for equation in data['equations']] == ['column_slide']


@pytest.mark.parametrize('name', ['\u03c62', '\u03c6\u2082', 'phi2', 'upper_arm_joint'])
def test_greek_letters_and_subscripts_are_taken(name, capsys):
    assert list(from_text(printed(capsys, 'four_link_robot.yaml', '--coordinate', name))) == ['phi2']


def test_options_choose_coordinates_and_form(capsys):
    text = printed(capsys, 'double_pendulum.yaml', '--joint', '--trigonometric', '--numeric')
    assert from_text(text)['q2'][0] == ('(0.333333 + 0.5*cos(q2))*q1_dd + 0.333333*q2_dd + 0.5*sin(q2)*q1_d**2')


TABLE_ROW = re.compile(r'^ *(-?[\d.e+-]+) +([\d.]+)%  (left|right) +(\w+(?: rate)?) +(\S.*)$', re.MULTILINE)


@pytest.mark.parametrize('form', [[], ['--joint'], ['--trigonometric'], ['--numeric', '--trigonometric']])
def test_table_of_contributions_is_sorted_and_its_sides_are_equal(form, capsys):
    state = ['--state', '0.1,0.2,-0.3,0.4,1.5/1,-2,0.5,0,3/0,1,2,3,4']
    for block in printed(capsys, 'four_link_robot.yaml', *state, *form).split('\n(5.')[1:]:
        rows = TABLE_ROW.findall(block)
        values = [float(row[0]) for row in rows]
        assert len(rows) > 5 and values == sorted(values, key=abs, reverse=True)
        left, right = (sum(value for value, row in zip(values, rows) if row[2] == side) for side in ('left', 'right'))
        told = [float(value) for value in re.findall(r'side (\S+) N', block)]
        size = sum(map(abs, values))
        assert abs(left - right) < 1e-5 * size and np.allclose(told, [left, right], rtol=0, atol=1e-5 * size)
        assert abs(sum(float(row[1]) for row in rows) - 100.0) < 0.06 * len(rows)     # shares are rounded to 0.1 %


def test_state_with_a_minus_in_front_is_no_option(capsys):
    one = printed(capsys, 'double_pendulum.yaml', '--state', '-0.5,0.2')
    assert one == printed(capsys, 'double_pendulum.yaml', '--state=-0.5,0.2/0,0/0,0')
    assert ' -2.0708 ' in one      # absolute: -0.5 - pi/2


def test_initial_state_is_the_chain_file_s(capsys):
    text = printed(capsys, 'arczewski_example.yaml', '--state', 'initial')
    assert 'at its initial state' in text
    assert re.search(r'\u03c6\u2084 +2 +1\.5 ', text)      # absolute: 0.3 - 0.8 + 2.5, 0.7 - 1.9 + 2.7


def test_state_of_a_log_is_the_simulation_s(log, capsys):
    chain = pcs.load_chain('four_link_robot.yaml')
    simulation, effort = pcs.Simulation(chain), np.array([3.0, 1.0, 0.5, 0.0, -0.2])
    simulation.advance(321, effort)
    data = json.loads(printed(capsys, str(log), '--time', '0.321', '--format', 'json'))
    equations = pcs.equations(chain)
    state = equations.state(simulation.position, simulation.velocity, effort=effort)
    for equation, row in zip(equations, data['equations']):
        for side in ('left', 'right'):
            assert [term['contribution'] for term in row[side]] == [
                term.contribution(state) for term in getattr(equation, side)]
    assert 'at t = 0.321 s of swing.mcap' in printed(capsys, str(log), '--time', '0.3213')
    assert from_text(printed(capsys, str(log))) == from_text(printed(capsys, 'four_link_robot.yaml'))


def test_table_in_latex_has_the_same_terms(capsys):
    arguments = ['four_link_robot.yaml', '--state', 'initial', '--coordinate', 'x1']
    rows = TABLE_ROW.findall(printed(capsys, *arguments))
    latex = printed(capsys, *arguments, '--format', 'latex')
    assert [float(value) for value in re.findall(r'^\$(.*?)\$ &', latex, re.MULTILINE)] == [
        float(row[0]) for row in rows]


def test_terms_that_are_rounding_count_as_zero():
    chain = pcs.chain_from_dict({'bodies': [{
        'name': 'arm', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0, 'center_of_mass': [0.5, 0.0],
        'rotation': {'joint': 'turn'}}]})
    equation, = pcs.equations(chain)
    state = pcs.equations(chain).state([np.pi / 2], [0.0], effort=[2.0])     # g . u is 6e-17 * 4.9
    assert [row.term.kind for row in contributions(equation, state)] == ['effort', 'acceleration']


@pytest.mark.slow
@pytest.mark.parametrize('ending, state, form', [
    ('png', [], []), ('svg', ['--state', 'initial'], ['--joint', '--trigonometric', '--coordinate', 'gripper_joint']),
    ('svg', [], ['--numeric']), ('png', ['--state', 'initial'], ['--numeric'])])
def test_picture_is_drawn(ending, state, form, tmp_path, capsys):
    pytest.importorskip('matplotlib')
    picture = tmp_path / f'picture.{ending}'
    printed(capsys, 'cart_arm_telescope.yaml', '--picture', str(picture), *state, *form)
    assert picture.read_bytes().startswith({'png': b'\x89PNG', 'svg': b'<?xml'}[ending])


def test_picture_takes_any_name_and_a_state_at_which_all_is_zero(tmp_path, capsys):
    pytest.importorskip('matplotlib')
    chain = tmp_path / 'odd.yaml'
    chain.write_text("name: '$x_{$'\nbodies:\n- {name: 'a$b', carrier: base, mass: 1, inertia: 1, "
                     "slide: {joint: 'a $_^% b$', axis: 0}}\n")
    for state in ([], ['--state', '0']):
        printed(capsys, str(chain), '--picture', str(tmp_path / f'odd{len(state)}.png'), *state)


@pytest.mark.parametrize('arguments, said', [
    ([], 'CHAIN'), (['no.yaml'], 'no.yaml'), (['four_link_robot.yaml', '--coordinate', 'phi9'], "'phi9'"),
    (['four_link_robot.yaml', '--coordinate', 'forearm_jiont'], "did you mean 'forearm_joint'"),
    (['four_link_robot.yaml', '--state', '1,2'], 'has 2 numbers, must have 5'),
    (['four_link_robot.yaml', '--state', '1,2,3,4,five'], "'five'"),
    (['four_link_robot.yaml', '--state', '1,2,3,4,nan'], 'must be finite'),
    (['four_link_robot.yaml', '--state', '1,2,3,4,5/1,2,3,4,5/1,2,3,4,5/1'], 'has 4 parts'),
    (['four_link_robot.yaml', '--time', '1'], '.mcap'), (['four_link_robot.yaml', '--format', 'html'], "'html'"),
    (['four_link_robot.yaml', '--picture', 'a.jpg'], "'.png' or '.svg'"),
    (['four_link_robot.yaml', '--picture', '/nowhere/a.png'], '/nowhere/a.png'), (['no.mcap'], 'no.mcap'),
    (['chain_32_links.yaml', '--state', 'initial', '--joint', '--coordinate', 'x'], "'x'"),
    (['four_link_robot.yaml', '--latex'], '--latex')])
def test_mistake_is_one_sentence(arguments, said, capsys):
    if '--picture' in arguments:
        pytest.importorskip('matplotlib')
    assert main(arguments) == 2
    out, err = capsys.readouterr()
    assert err.startswith('equations: ') and err.count('\n') == 1 and said in err and out == ''


@pytest.mark.parametrize('time', ['0.6', '-0.1', 'nan', 'inf'])
def test_time_that_a_log_does_not_hold(log, time, capsys):
    assert main([str(log), '--time', time]) == 2
    assert 'holds the states from 0 s to 0.5 s' in capsys.readouterr().err


def test_one_state_at_a_time(log, capsys):
    assert main([str(log), '--time', '0.1', '--state', 'initial']) == 2
    assert 'must be one' in capsys.readouterr().err


def command(*arguments, **options):
    return subprocess.run([sys.executable, '-m', 'planar_chain_sim.symbolic.command_line', *arguments],
                          capture_output=True, **options)


def test_a_pipe_gets_utf_8_whatever_the_locale(monkeypatch):
    monkeypatch.setenv('PYTHONIOENCODING', 'ascii')
    run = command('double_pendulum.yaml')
    assert run.returncode == 0 and '\u03c6\u0308\u2082' in run.stdout.decode()


def test_a_reader_that_goes_and_a_full_disk_are_no_traceback():
    gone = subprocess.run(['bash', '-c', '"$0" -m planar_chain_sim.symbolic.command_line chain_32_links.yaml | head -1',
                           sys.executable], capture_output=True, text=True)
    assert gone.stdout == 'chain_32_links: equations of motion in absolute angles\n' and gone.stderr == ''
    with open('/dev/full', 'w') as full:
        run = subprocess.run([sys.executable, '-m', 'planar_chain_sim.symbolic.command_line', 'double_pendulum.yaml'],
                             stdout=full, stderr=subprocess.PIPE, text=True)
    assert run.returncode == 2 and run.stderr.count('\n') == 1 and 'cannot be written' in run.stderr


def test_help_has_an_example():
    run = command('--help', text=True)
    assert run.returncode == 0 and '\nexample:\n  equations config/' in run.stdout
