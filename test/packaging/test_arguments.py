"""Every executable: hundreds of odd arguments end in one sentence and exit code 2, and leave no file."""
import errno
import os
from pathlib import Path
from random import Random
import re
import signal
import subprocess
import sys

import numpy as np
import pytest

import planar_chain_sim as pcs
from planar_chain_sim import command_line, urdf_file
from planar_chain_sim.benchmark import command_line as benchmark
from planar_chain_sim.executables import MODULES as EXECUTABLES
from planar_chain_sim.pictures import animation, plot
from planar_chain_sim.recording import info, repair, rollout
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.resimulation import command_line as resimulation
from planar_chain_sim.symbolic import command_line as equations
from planar_chain_sim.view import command_line as view

ROBOT = 'four_link_robot.yaml'
MODULES = {'rollout': 'recording.rollout', 'resimulate': 'resimulation.command_line', 'replay': 'ros.replay',
           'equations': 'symbolic.command_line', 'benchmark': 'benchmark.command_line', 'simulator': 'ros.node',
           'example_controller': 'ros.example_controller', 'urdf': 'urdf_file', 'plot': 'pictures.plot',
           'animate': 'pictures.animation', 'view': 'view.command_line', 'info': 'recording.info',
           'repair': 'recording.repair'}
DOORS = {'rollout': rollout.main, 'resimulate': resimulation.main, 'equations': equations.main,
         'benchmark': benchmark.main, 'urdf': urdf_file.main, 'plot': plot.main,
         'animate': animation.main, 'view': view.main, 'info': info.main, 'repair': repair.main}
ODD = [
    '', ' ', '-', '--', '---', '-1', '-1,2,0', '-1e3,2,0,0,0', '0', '1e300', '-1e300', '1e-300', '1e309', 'nan',
    '-nan', 'inf', '-inf', '1_000', '0x10', '1,2', '1,,2', 'a=b', 'a=', '=1', '=', 'column_slide=1',
    'column_slide=1,column_slide=2', 'column_slide=x', 'colum_slide=1', '\xe9t\xe9.yaml', '\u4e2d\u6587', '\udcff',
    'a\nb', 'a\tb', 'a\x00b', '%s', '{}', "'", '"', '\\', '/', '.', '..', '/dev/null', '/dev/full', '/dev/zero',
    '/proc/self/mem', '~', '*', 5000 * 'x', '--help=1', '--no-such', '-h1', 'pi/2', '90deg', 'pi/0', 400 * '9',
    '1000000000000000000000000000000', 'true', 'none', 'None', '[1,2]', ROBOT, 'run.mcap', 'no.csv', 'no.npy', '1;2',
    '1 2 3 4 5', '\ufeff1', '\u0661', '1e', '1e5e5', '+1', '.', '0.1.2']


@pytest.fixture(scope='module')
def folder(tmp_path_factory):
    """Return a folder with a short log, run.mcap, and one that was cut short, torn.mcap."""
    path = tmp_path_factory.mktemp('doors')
    assert rollout.main([ROBOT, '--duration', '0.01', '--output', str(path / 'run.mcap')]) == 0
    (path / 'torn.mcap').write_bytes((path / 'run.mcap').read_bytes()[:-100])
    return path


def command(name, *arguments, **options):
    return subprocess.run([sys.executable, '-m', f'planar_chain_sim.{MODULES[name]}', *map(str, arguments)],
                          capture_output=True, text=True, timeout=600, **options)


def is_one_sentence(name, said):
    assert said.startswith(f'{name}: ') and said.count('\n') == 1 and 'Traceback' not in said, said[-600:]
    assert len(said) < 7000


def odd_arguments(random, name):
    """Return arguments of an executable with something odd among them."""
    flags = {'rollout': ['--output', '--duration', '--step', '--method', '--tolerance', '--position', '--velocity',
                         '--effort', '--compression'],
             'resimulate': [],
             'equations': ['--format', '--joint', '--coordinate', '--state', '--time', '--numeric'],
             'benchmark': ['--csv', '--picture', '--folder', '--peers'],
             'urdf': ['--output', '--commands', '--states'],
             'plot': ['--output', '--what', '--joints', '--from', '--to', '--trace'],
             'animate': ['--output', '--duration', '--speed', '--size', '--from', '--trail', '--trace'],
             'view': ['--port', '--host', '--hold'],
             'info': [],
             'repair': ['--output', '--outptu']}[name]
    first = {'rollout': [ROBOT], 'resimulate': ['run.mcap'], 'equations': [random.choice([ROBOT, 'run.mcap'])],
             'benchmark': [random.choice(['references', 'all', 'calls', 'nothing'])],
             'urdf': [ROBOT], 'plot': [random.choice([ROBOT, 'run.mcap'])],
             'animate': [random.choice([ROBOT, 'run.mcap'])],
             'view': [ROBOT], 'info': ['run.mcap'], 'repair': ['torn.mcap']}[name]
    arguments = list(first)
    for _ in range(random.randint(1, 3)):
        if flags and random.random() < 0.8:
            arguments += [random.choice(flags), random.choice(ODD)]
        else:
            arguments.insert(random.randrange(len(arguments) + 1), random.choice(ODD))
    if random.random() < 0.2:
        arguments[0] = random.choice(ODD)
    return arguments


@pytest.mark.parametrize('name', ['rollout', 'resimulate', 'equations', 'urdf', 'plot', 'animate', 'view', 'info',
                                  'repair'])
def test_odd_arguments_by_the_hundred(name, folder, monkeypatch, capsys):
    """In one process: 0 and a result, or 2 and one sentence. What was refused leaves no file."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(pcs.OfflineLog, 'advance', lambda *arguments: None)    # 1e9 s would take a while
    monkeypatch.setattr(plot, 'draw', lambda *arguments: b'')
    for kind in ('gif', 'mp4', 'svg', 'html'):
        monkeypatch.setattr(animation, f'write_{kind}', lambda *arguments: None)
    monkeypatch.setattr(view, 'serve', lambda *arguments: 0)    # which goes on until a stop signal
    random, refused, kept = Random(name), 0, set(folder.iterdir())
    for _ in range(400):
        arguments = odd_arguments(random, name)
        try:
            code = DOORS[name](arguments)
        except SystemExit as end:
            assert end.code == 0 and any(each.startswith('-h') or each == '--help' for each in arguments)
            code = 0
        out, err = capsys.readouterr()
        made = set(folder.iterdir()) - kept
        assert code in (0, 2), arguments
        if code == 2:
            refused += 1
            is_one_sentence(name, ''.join(line for line in err.splitlines(True) if f'{name}: note: ' not in line))
            assert not made, (arguments, made)
        for path in made:
            path.unlink()
    assert refused > 200


def test_odd_arguments_of_the_benchmark(folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    monkeypatch.setattr(benchmark, 'run_suite', lambda *arguments: None)     # which takes minutes
    random, refused = Random(4), 0
    for _ in range(150):
        arguments = odd_arguments(random, 'benchmark')
        try:
            code = benchmark.main(arguments)
        except SystemExit as end:
            assert end.code == 0
            continue
        assert code in (0, 2), arguments
        refused += code == 2
        if code == 2:
            is_one_sentence('benchmark', capsys.readouterr().err)
    assert refused > 80


def test_odd_arguments_of_replay():
    """Only the options are tested here; test_replay runs the node."""
    from planar_chain_sim.ros.replay import parse
    random, refused = Random(5), 0
    for _ in range(400):
        arguments = ['run.mcap']
        for _ in range(random.randint(1, 3)):
            arguments += [random.choice(['--speed', '--start', '--wait', '--what', '--loop']), random.choice(ODD)]
        try:
            options = parse(arguments)
        except command_line.Mistake as mistake:
            refused += 1
            assert str(mistake)
        except SystemExit as end:
            assert end.code == 0
        else:
            assert 0.0 < options.speed < np.inf and 0.0 <= options.start < np.inf and 0.0 <= options.wait < np.inf
    assert refused > 100


@pytest.mark.parametrize('name, arguments', [
    ('rollout', [ROBOT, '--output']), ('urdf', [ROBOT, '--output']), ('plot', [ROBOT, '--output']),
    ('plot', ['run.mcap', '--output']), ('repair', ['torn.mcap', '--output']),
    ('equations', [ROBOT, '--picture']), ('equations', ['run.mcap', '--time', '0.01', '--picture'])])
def test_an_output_that_exists_is_not_overwritten(name, arguments, folder, monkeypatch, capsys):
    """The file may be the input, which would then be lost."""
    monkeypatch.chdir(folder)
    output = 'kept.png'
    Path(output).write_text('precious')
    assert DOORS[name]([*arguments, output]) == 2
    said = capsys.readouterr().err
    assert said.startswith(f'{name}: ') and "'kept.png': the file exists and is not overwritten" in said
    assert Path(output).read_text() == 'precious'
    Path(output).unlink()


@pytest.mark.slow
@pytest.mark.parametrize('name', MODULES)
@pytest.mark.parametrize('arguments', [['--no-such-option'], ['a', 'b', 'c', 'd'], ['\u4e2d\udcff', '\n']])
def test_every_executable_refuses_in_one_sentence(name, arguments, tmp_path):
    done = command(name, *arguments, cwd=tmp_path, errors='surrogateescape')
    assert done.returncode == 2 and done.stdout == ''
    is_one_sentence(name, done.stderr)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize('columns', [80, 110])
@pytest.mark.parametrize('name', MODULES)
def test_help_is_as_wide_as_the_terminal_and_has_an_example(name, columns, monkeypatch, capsys):
    monkeypatch.setenv('COLUMNS', str(columns))
    if name in DOORS:
        with pytest.raises(SystemExit) as end:
            DOORS[name](['--help'])
        code, (out, err) = end.value.code, capsys.readouterr()
    else:   # an executable with ROS, as a process
        done = command(name, '--help')
        code, out, err = done.returncode, done.stdout, done.stderr
    assert code == 0 and '\nexample:\n  ' in out and err == ''
    widest = max(map(len, out.splitlines()))
    assert widest <= columns
    assert widest > 0.75 * columns    # and uses it


def test_example_of_a_help_is_a_command_that_a_shell_takes():
    """Broken lines are joined by a backslash."""
    narrow, wide = (command('rollout', '--help', env={**os.environ, 'COLUMNS': columns}).stdout.partition('example:')[2]
                    for columns in ('60', '200'))
    assert '\\\n' in narrow
    assert re.sub(r' \\\n +', ' ', narrow) == wide


class Bug(Exception):
    """No mistake of a user's."""


@pytest.mark.parametrize('error', [Bug('x'), ValueError('x'), KeyError('x'), TypeError('x'), RuntimeError('x'),
                                   AttributeError('x'), FileNotFoundError(errno.ENOENT, 'x', 'file'), AssertionError(),
                                   OSError(errno.EINVAL, 'x'), RecursionError('x'), StopIteration(), UnicodeError('x')])
def test_a_bug_shows_its_traceback_and_is_no_difference(error, folder, monkeypatch, capsys):
    def fail(*arguments, **options):
        raise error
    monkeypatch.chdir(folder)
    for module, name, arguments in (
            (resimulation, 'resimulate', ['run.mcap']), (rollout, 'Simulation', [ROBOT]),
            (equations, 'equations', [ROBOT]), (rollout, 'OfflineLog', [ROBOT, '--output', 'b'])):
        if isinstance(error, (ValueError, KeyError)) and name == 'Simulation':
            continue     # how it says that an argument is wrong
        with monkeypatch.context() as patch:
            patch.setattr(module, name, fail)
            assert module.main(arguments) == 2
        said = capsys.readouterr().err
        assert said.startswith('Traceback (most recent call last):') and type(error).__name__ in said.splitlines()[-1]
        Path('b').unlink(missing_ok=True)


@pytest.mark.parametrize('error, said', [
    (MemoryError('9 TiB'), 'there is not enough memory (9 TiB), try a smaller task'),
    (OSError(errno.ENOSPC, 'No space left on device'), 'its output cannot be written (No space left on device)'),
    (pcs.SimulationError('it stopped'), 'it stopped'), (pcs.ChainError('no chain'), 'no chain')])
def test_a_mistake_is_one_sentence(error, said, folder, monkeypatch, capfd):
    def fail(*arguments):
        raise error
    keep = os.dup(1)     # a writer that has ended closes its output
    try:
        monkeypatch.setattr(resimulation, 'resimulate', fail)
        assert resimulation.main([str(folder / 'run.mcap')]) == 2
    finally:
        os.dup2(keep, 1)
        os.close(keep)
    told = capfd.readouterr().err
    is_one_sentence('resimulate', told)
    assert said in told


@pytest.fixture(scope='module')
def different(folder):
    """Return a log of which one state is not what comes out."""
    content = bytearray((folder / 'run.mcap').read_bytes())
    state = [message for message in read_log(folder / 'run.mcap').messages if message.sequence == 7][0].data
    place = content.index(state) + len(state) - 48 - 8     # the last velocity
    content[place] ^= 1
    path = folder / 'different.mcap'
    path.write_bytes(content)
    return path


@pytest.mark.slow
@pytest.mark.parametrize('unbuffered', ['', '1'])
def test_a_reader_that_goes(folder, different, unbuffered, tmp_path):
    """As in `... | head`: no message, a complete log, and exit code 1 for a difference."""
    def code_of(name, *arguments):
        module = f'planar_chain_sim.{MODULES[name]}'
        done = subprocess.run(['bash', '-c', 'exec 3>&1; { sleep 0.1; "$@" 3>&-; echo $? >&3; } | true', 'bash',
                               sys.executable, '-m', module, *map(str, arguments)], capture_output=True, text=True,
                              env={**os.environ, 'PYTHONUNBUFFERED': unbuffered})
        assert done.stderr == '', done.stderr
        return int(done.stdout)
    assert code_of('resimulate', folder / 'run.mcap') == 0
    assert code_of('resimulate', different) == 1
    assert code_of('rollout', ROBOT, '--duration', '0.1', '--output', tmp_path / 'run.mcap') == 0
    assert read_log(tmp_path / 'run.mcap').complete
    for name in MODULES if not unbuffered else ():   # the way that everybody starts them
        assert code_of(name, '--help') == 0


@pytest.mark.slow
def test_a_full_disk_is_one_sentence_and_no_difference(folder, different, tmp_path):
    for name, *arguments in (('resimulate', folder / 'run.mcap'), ('resimulate', different), ('equations', ROBOT),
                             ('rollout', ROBOT, '--duration', '0.1', '--output', tmp_path / 'run.mcap'),
                             *((name, '--help') for name in MODULES)):
        with open('/dev/full', 'w') as full:
            done = subprocess.run([sys.executable, '-m', f'planar_chain_sim.{MODULES[name]}', *map(str, arguments)],
                                  stdout=full, stderr=subprocess.PIPE, text=True)
        assert done.returncode == 2, (name, arguments, done.stderr)
        is_one_sentence(name, done.stderr)
        assert 'cannot be written' in done.stderr


def test_a_log_that_cannot_be_begun_leaves_no_file(tmp_path):
    import resource
    done = command('rollout', ROBOT, '--output', tmp_path / 'run.mcap',
                   preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0)))
    assert done.returncode == 2
    is_one_sentence('rollout', done.stderr)
    assert not list(tmp_path.iterdir())


def test_letters_that_the_locale_has_not_are_printed_as_escapes(tmp_path):
    path = tmp_path / 'gr\u00fc\u00dfe.yaml'
    path.write_text((Path(__file__).parents[2] / 'config' / ROBOT).read_text().replace('four_link_robot', '\u4e2d'))
    done = command('rollout', path, '--duration', '0.01', cwd=tmp_path,
                   env={**os.environ, 'PYTHONIOENCODING': 'ascii'})
    assert done.returncode == 0 and done.stderr == '' and '\\u4e2d: ' in done.stdout
    assert (tmp_path / 'gr\u00fc\u00dfe.mcap').exists()
    assert command('resimulate', tmp_path / 'gr\u00fc\u00dfe.mcap').returncode == 0


@pytest.mark.slow
@pytest.mark.parametrize('closed', ['2>&-', '>&-', '>&- 2>&-', '<&- >&- 2>&-'])
def test_standard_streams_that_are_closed_are_as_if_nobody_reads(closed, tmp_path):
    """As when a daemon starts a process with closed streams; none of our files gets the number of a stream."""
    log = tmp_path / 'run.mcap'
    for name, *arguments in (('rollout', ROBOT, '--duration', '0.1', '--output', log), ('resimulate', log),
                             *((name, '--help') for name in MODULES if closed.count('&-') == 3)):
        shell = f'"$@" {closed}; echo $? > {tmp_path}/code'
        done = subprocess.run(['bash', '-c', shell, 'bash', sys.executable, '-m', f'planar_chain_sim.{MODULES[name]}',
                               *map(str, arguments)], capture_output=True, text=True, timeout=600)
        assert (tmp_path / 'code').read_text() == '0\n' and done.stderr == '', (name, done.stderr)
    assert sum(message.topic == '/joint_states' for message in read_log(log).messages) == 101


def test_a_note_that_cannot_be_written_does_not_end_the_run(tmp_path):
    robot, log = tmp_path / 'robot.urdf', tmp_path / 'run.mcap'
    robot.write_text('<robot name="r"><link name="world"/><link name="a"><inertial><mass value="1"/>'
                     '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>'
                     '<joint name="j" type="continuous"><parent link="world"/><child link="a"/><axis xyz="0 1 0"/>'
                     '</joint></robot>')
    with open('/dev/full', 'w') as full:
        code = subprocess.run([sys.executable, '-m', 'planar_chain_sim.recording.rollout', robot, '--duration', '0.1',
                               '--output', log], stdout=subprocess.DEVNULL, stderr=full, timeout=600).returncode
    assert code == 0 and read_log(log).complete


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize('name', sorted({*EXECUTABLES} - {'benchmark'}))   # which imports little at first
def test_a_stop_signal_in_the_midst_of_the_imports_is_one_line(name, number, tmp_path):
    """Python says which modules have been imported: NumPy's first is long before the last."""
    process = subprocess.Popen(
        [sys.executable, '-X', 'importtime', '-c', f'from planar_chain_sim.executables import {name}; {name}()'],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    for line in process.stderr:
        if 'numpy' in line:
            break
    process.send_signal(number)
    out, err = process.communicate(timeout=600)
    said = [line for line in err.splitlines() if not line.startswith('import time:')]
    assert process.returncode == 128 + number and out == '' and said == [f'{name}: interrupted']


def test_every_executable_without_ros_begins_in_one_module():
    setup = (Path(__file__).resolve().parents[2] / 'setup.py').read_text()
    assert re.findall(r"f'(\w+) = \{NAME\}\.executables:(\w+)'", setup) == [(name, name) for name in EXECUTABLES]
