"""plot: the numbers of logs against time, however long they are; what it compares, and what it refuses."""
import sys

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.motion.simulation import Simulation
from planar_chain_sim.pictures import panels, plot
from planar_chain_sim.pictures.energies import energies, energy_error
from planar_chain_sim.pictures.figure import pyplot_in_style
from planar_chain_sim.pictures.panels import kept_rows, thinned
from planar_chain_sim.pictures.source import Source, source_of_log
from planar_chain_sim.recording import rollout
from planar_chain_sim.recording.seekable_log import SeekableLog

EFFORT = [5.0, 10.0, 0.0, 0.0, 0.0]


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder with two logs of one chain, one of another, and one of a run with many changes."""
    path = tmp_path_factory.mktemp('logs')
    for name, *arguments in (('one', 'four_link_robot.yaml'), ('far', 'double_pendulum.yaml'),
                             ('other', 'four_link_robot.yaml', '--effort', '5,10,0,0,0')):
        assert rollout.main([*arguments, '--duration', '0.5', '--output', str(path / f'{name}.mcap')]) == 0
    simulation = Simulation(pcs.load_chain('four_link_robot.yaml'))
    with pcs.OfflineLog(str(path / 'changed.mcap'), simulation) as log:
        log.advance(200, effort=EFFORT)
        log.change('wrench', body='forearm', force=[4.0, -2.0], moment=0.5, axes='world')
        log.change('wrench', body='column', force=[1.0, 3.0])
        log.advance(200)
        log.change('payload', name='load', body='side_arm', mass=0.5, position=[0.3, 0.1])
        log.change('parameter', name='gravity', value=[0.5, -3.0])
        log.advance(300)
        log.change('reset')
        log.advance(100)
    return path


@pytest.fixture
def drawn(folder, monkeypatch):
    """Return a function that calls plot and returns the axes of its figure by their titles, and the legend's texts."""
    monkeypatch.chdir(folder)

    def draw(*arguments):
        figures = []
        with monkeypatch.context() as patch:
            patch.setattr(panels, 'picture_of', lambda figure, kind: figures.append(figure) or b'')
            assert plot.main([*arguments, '--output', 'drawn.png']) == 0
        (folder / 'drawn.png').unlink()
        legend = [text.get_text() for each in figures[0].legends for text in each.get_texts()]
        pyplot_in_style().close(figures[0])
        return {axes.get_title(): axes for axes in figures[0].axes}, legend
    return draw


def test_curves_are_the_numbers_of_the_log(drawn):
    axes, legend = drawn('other.mcap')
    log = pcs.load_log('other.mcap')
    assert legend == list(log.chain.joint_names)
    for quantity, units in (('position', 'rad m'), ('velocity', 'rad/s m/s'), ('effort', 'N_m N')):
        for kind, unit, joints in zip(('rotations', 'slides'), units.split(), ([1, 2, 3, 4], [0])):
            lines = axes[f'{kind}: {quantity}, {unit.replace("_", " ")}'].lines
            for joint, line in zip(joints, lines[:len(joints)]):
                values = getattr(log, quantity)[:, joint]
                np.testing.assert_array_equal(line.get_xdata(), log.time)
                np.testing.assert_array_equal(line.get_ydata()[:len(values)], values)
    kinetic, potential, total = axes['energy, J'].lines[:3]
    wanted = pcs.energy(log.chain, log.position, log.velocity)
    np.testing.assert_allclose([kinetic.get_ydata(), potential.get_ydata()], wanted, rtol=1e-12)
    np.testing.assert_allclose(total.get_ydata(), sum(wanted), rtol=1e-12)
    assert 0.0 < np.abs(axes['energy beyond work and losses, J'].lines[0].get_ydata()).max() < 1e-6
    poses = pcs.body_poses(log.chain, log.position)
    for line, body in ((axes['paths'].lines[0], 2), (axes['paths'].lines[2], 3)):
        tip = 2.0 * poses.center_of_mass[:, body] - poses.point[:, body]
        np.testing.assert_allclose(np.transpose(line.get_data()), tip, atol=1e-12)


def test_a_part_of_the_time_and_some_joints(drawn):
    axes, legend = drawn('one.mcap', '--from', '0.1', '--to', '0.2', '--joints', 'forearm_joint,column_slide', '--what',
                         'position,path', '--trace', 'column=0.5,0.25')
    log = pcs.load_log('one.mcap')
    assert legend == ['forearm_joint', 'column_slide']
    assert set(axes) == {'rotations: position, rad', 'slides: position, m', 'paths'}
    line, = axes['rotations: position, rad'].lines
    np.testing.assert_array_equal(line.get_ydata(), log.position[100:201, 3])
    poses = pcs.body_poses(log.chain, log.position[100:201])
    turned = np.exp(1j * poses.angle[:, 0]) * (0.5 + 0.25j)
    np.testing.assert_allclose(axes['paths'].lines[0].get_xdata(), poses.point[:, 0, 0] + turned.real, atol=1e-12)


def test_several_logs_are_told_apart(drawn, capsys):
    axes, legend = drawn('one.mcap', 'other.mcap', '--what', 'position,path')
    assert [line.get_linestyle() for line in axes['paths'].lines if len(line.get_xdata()) > 1] == 2 * ['-'] + 2 * ['--']
    assert legend[-2:] == ['one.mcap', 'other.mcap']
    lines = axes['slides: position, m'].lines
    assert [line.get_linestyle() for line in lines[:2]] == ['-', '--'] and lines[0].get_color() == lines[1].get_color()
    assert capsys.readouterr().err == ''
    _, legend = drawn('one.mcap', './one.mcap', '--what', 'position')
    assert legend[-2:] == ['one.mcap', './one.mcap']


def test_what_cannot_be_compared_is_said(drawn, capsys):
    drawn('one.mcap', 'far.mcap', '--what', 'position')
    assert capsys.readouterr().err == ('plot: warning: column_slide, column_joint, upper_arm_joint and 4 more cannot '
                                       'be compared, as not all files have such a joint\n')


def test_a_time_that_a_log_does_not_hold_is_said(drawn, capsys):
    drawn('one.mcap', '--from', '0', '--to', '0.5')
    assert capsys.readouterr().err == ''
    drawn('one.mcap', '--to', '99')
    assert "warning: 'one.mcap' holds no more than is drawn, 0 to 0.5 s" in capsys.readouterr().err


def test_events_are_marked(drawn):
    axes, _ = drawn('changed.mcap')
    marked = {line.get_xdata()[0] for line in axes['rotations: velocity, rad/s'].lines[4:]}
    assert marked == {0.2, 0.4, 700 * 0.001}
    kinds = [text.get_text() for text in axes['events'].get_yticklabels()]
    assert set(kinds) == {'command', 'reset', 'wrench', 'payload', 'parameter'}
    assert axes['events'].lines[kinds.index('payload')].get_xdata() == [0.4]


def whole(path, *part):
    with SeekableLog(path) as log:
        return source_of_log(log, *part)


def test_energy_balances_through_all_changes(folder):
    """Wrenches in both kinds of axes, a payload, another gravity; each part against sums of its own."""
    source = whole(folder / 'changed.mcap')
    time, error = energy_error(source)
    assert np.abs(error).max() < 1e-6 < 1e-3 * np.ptp(energies(source, np.arange(801)))
    assert {*time[error == 0.0]} == {0.0, 400 * 1e-3, 700 * 1e-3}     # at the start, after changes, not after wrenches
    kinetic, potential = energies(source, np.array([0, 450, 800]))
    heavy = Simulation(source.chain)
    heavy.set_state(source.position[450], source.velocity[450])
    heavy.attach('side_arm', 0.5, [0.3, 0.1], name='load')
    light = pcs.energy(source.chain.with_parameters({'gravity.x': 0.5, 'gravity.y': -3.0}), source.position[450],
                       source.velocity[450])
    assert kinetic[1] == pytest.approx(pcs.energy(heavy.chain, heavy.position, heavy.velocity)[0], rel=1e-12)
    assert kinetic[1] > light[0] and potential[1] != pytest.approx(light[1], rel=1e-3)


def test_a_work_that_is_left_out_would_show(folder):
    source = whole(folder / 'changed.mcap')
    without = Source(**{**vars(source), 'events': [each for each in source.events if each['kind'] != 'wrench']})
    assert np.abs(energy_error(without)[1]).max() > 1e-2


@pytest.mark.parametrize('name', ['other', 'changed'])
def test_a_part_of_a_log_is_read_as_the_whole(name, folder):
    """The same rows, and the events that change them, also those before; of the others those in that time."""
    log, every = pcs.load_log(folder / f'{name}.mcap'), whole(folder / f'{name}.mcap')
    for quantity in ('time', 'position', 'velocity', 'effort'):
        np.testing.assert_array_equal(getattr(every, quantity), getattr(log, quantity))
    assert every.events == log.events
    part = whole(folder / f'{name}.mcap', 0.201, 0.45)
    for quantity in ('time', 'position', 'velocity'):
        np.testing.assert_array_equal(getattr(part, quantity), getattr(log, quantity)[200:452])
    np.testing.assert_array_equal(part.effort, log.effort[200:451])
    assert part.events == [event for event in log.events if event['tick'] <= 451 and (
        event['tick'] >= 200 or event['kind'] != 'command')]
    rows = np.arange(len(part.time))
    np.testing.assert_allclose(energies(part, rows), energies(every, rows + 200), rtol=1e-12)


def test_a_long_log_is_thinned_and_keeps_its_extremes(tmp_path):
    values = np.sin(np.arange(1_000_003) * 1e-3)
    values[[123_456, 777_777, 1_000_002]] = 5.0, -7.0, 3.0
    rows = kept_rows(values)
    assert len(rows) < 6000 and (np.diff(rows) > 0).all() and rows[0] == 0 and rows[-1] == 1_000_002
    time, kept = thinned(np.arange(1_000_003.0), values)
    assert {5.0, -7.0, 3.0} <= {*kept} and time[kept == 5.0] == [123_456.0]
    chain = pcs.load_chain('double_pendulum.yaml')
    both = np.stack([values, -values], axis=1)
    long = Source('long', chain, 1e-3, np.arange(1_000_003) * 1e-3, both, both, both[1:], [])
    what = ['position', 'effort', 'energy', 'path']
    picture = panels.draw([long], [[(1, None)]], what, list(chain.joint_names), 'svg')
    assert len(picture) < 2e6


@pytest.mark.parametrize('kind, begin', [('png', b'\x89PNG'), ('svg', b'<?xml'), ('pdf', b'%PDF')])
def test_kinds_of_files(kind, begin, folder, tmp_path, monkeypatch, capsys):
    """The same bytes each time, and an ending in capitals is that ending."""
    monkeypatch.chdir(tmp_path)
    for name in (f'a.{kind}', f'b.{kind.upper()}'):
        assert plot.main([str(folder / 'one.mcap'), '--what', 'velocity,path', '--output', name]) == 0
    content = (tmp_path / f'a.{kind}').read_bytes()
    assert content.startswith(begin) and content == (tmp_path / f'b.{kind.upper()}').read_bytes()
    assert capsys.readouterr().err == ''


def test_all_that_can_be_drawn_is_drawn(folder, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert plot.main([str(folder / 'one.mcap'), '--what', ','.join(panels.WHAT)]) == 0
    assert (tmp_path / 'one.png').stat().st_size > 50_000
    assert capsys.readouterr().err == ''


def test_odd_names_are_drawn_as_they_are(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    chain = pcs.chain_from_dict({'name': 'a', 'bodies': [
        {'name': '$a', 'carrier': 'base', 'mass': 1.0, 'inertia': 1.0, 'rotation': {'joint': '_j$\\frac$'}},
        {'name': '_b', 'carrier': '$a', 'mass': 1.0, 'inertia': 1.0, 'rotation': {'joint': '$x_$y'}}]})
    (tmp_path / 'odd$.yaml').write_text(chain.source)
    assert plot.main(['odd$.yaml', 'odd$.yaml', '--to', '0.1', '--output', 'odd.svg']) == 0
    assert (tmp_path / 'odd.svg').stat().st_size > 10_000


@pytest.mark.parametrize('arguments, sentence', [
    (['--joints', 'forearm'], "--joints: there is no 'forearm' (did you mean 'forearm_joint'?), must be among column_"),
    (['--what', 'speed'], "--what: there is no 'speed', must be among position, velocity, effort, energy,"),
    (['--what', ''], "--what: there is no ''"),
    (['--from', 'nan'], '--from is nan, must be a number of seconds'),
    (['--from', '3', '--to', '2'], '--from is 3 s, must be below --to, 2 s'),
    (['--from', '7'], "'one.mcap' has no motion in this time, it holds 0 to 0.5 s"),
    (['--output', ''], "--output is '', must end in .png, .svg, .pdf"),
    (['--output', 'one.gif'], "--output is 'one.gif', must end in .png, .svg, .pdf"),
    (['--output', 'one.mcap'], "--output is 'one.mcap', must end in"),
    (['--output', 'nowhere/one.png'], "'nowhere/one.png': No such file or directory"),
    (['--hold', 'column_slide'], '--hold is for chain files, but the file given is a log'),
    (['one.mcap', 'one.mcap', 'one.mcap', 'one.mcap'], '5 files are given, at most 4 can be told apart in one picture'),
    (['four_link_robot.yaml', '--to', '1e6'], '--to is 1e+06 s, must be from 0.001 to 1000 for a chain file')])
def test_refusals(arguments, sentence, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    before = sorted(folder.iterdir())
    assert plot.main(['one.mcap', *arguments]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'plot: {sentence}') and said.count('\n') == 1, said
    assert sorted(folder.iterdir()) == before


def test_what_to_install_is_said(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setitem(sys.modules, 'matplotlib', None)
    assert plot.main(['one.mcap']) == 2
    assert '`pip install matplotlib pillow imageio-ffmpeg`' in capsys.readouterr().err
