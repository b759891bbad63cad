"""The executable `simulator` as a process: how it ends, and its sentence for a user's mistake."""
import os
from pathlib import Path
import random
import resource
import signal
import subprocess
import sys
import time

from live import CONFIG, PATIENCE, Process, run, simulator
import pytest

from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.rollout import main as rollout
from planar_chain_sim.ros.parameters import PARAMETERS
from planar_chain_sim.ros.process import run_until_stopped

NODE = 'planar_chain_sim.ros.node'
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
TRIALS = int(os.environ.get('SOAK', 2))  # `make soak` wants more


def catches(process, number):
    """Tell whether the process has a handler for this signal; Python itself has none for SIGTERM."""
    for line in Path(f'/proc/{process.popen.pid}/status').read_text().splitlines():
        if line.startswith('SigCgt:'):
            return bool(int(line.split()[1], 16) >> (number - 1) & 1)
    return False


def starting(**parameters):
    """Start the node and return it at the moment at which its handlers stand."""
    process = simulator(ready=False, **parameters)
    end = time.monotonic() + PATIENCE
    while not catches(process, signal.SIGTERM):
        assert process.popen.poll() is None and time.monotonic() < end, process.output
        time.sleep(0.001)
    return process


@pytest.mark.parametrize('number', STOPS)
@pytest.mark.parametrize('trial', range(TRIALS))
def test_a_stop_signal_is_a_clean_end(number, trial, tmp_path):
    with simulator(record=tmp_path / 'run.mcap') as process:
        assert process.stop(number) == 0
    assert 'running' in process.lines[0] and 'send efforts to' in process.lines[1] and 'see it' in process.lines[2]
    # A busy machine may be late.
    assert [line for line in process.lines[3:] if 'late and dropped' not in line and 'held up' not in line] == []
    assert read_log(tmp_path / 'run.mcap').complete


@pytest.mark.parametrize('number', STOPS)
@pytest.mark.parametrize('trial', range(TRIALS + 1))
def test_a_stop_signal_during_start(number, trial, tmp_path):
    path = tmp_path / 'run.mcap'
    with starting(record=path) as process:
        time.sleep(random.uniform(0.0, 0.15) * min(trial, 4))  # any moment of the start will do
        assert process.stop(number) == 0, process.output
    assert 'Traceback' not in process.output
    assert not path.exists() or read_log(path).complete


@pytest.mark.parametrize('trial', range(3))
def test_stop_signals_that_do_not_stop_coming(trial):
    with simulator() as process:
        while process.popen.poll() is None:
            process.send(STOPS[trial % 3])
            process.send(signal.SIGINT)
            time.sleep(0.002)
        assert process.finish() == 0, process.output
    assert len(process.lines) <= 3, process.output


def refusal(*arguments, **options):
    """Run the node into a refusal and return its one sentence."""
    code, output = run(NODE, *arguments, **options)
    assert code == 2, output
    assert output.count('\n') == 0 and output.startswith('simulator: '), output
    return output.partition(': ')[2]


@pytest.mark.parametrize('parameter, sentence', [
    ('rate:=-5', "parameter 'rate' is -5.0, must be from 1 to 100000"),
    ('method:=euler2', "parameter 'method' is 'euler2', must be one of 'auto', "),
    ('chain_file:=no_such.yaml', 'no_such.yaml'),
    ('chain_file:=/', 'must be a chain file in YAML'),
    ('record:=/no/such/folder/run.mcap', "log '/no/such/folder/run.mcap': its folder '/no/such/folder' does not exist"),
    (f'record:={__file__}', f"log '{__file__}': the file exists and is not overwritten, give a new name")])
def test_a_bad_parameter_is_one_sentence(parameter, sentence):
    assert sentence in refusal('--ros-args', '-p', parameter)


def test_an_unknown_argument_is_one_sentence():
    assert refusal('swing.yaml', 'b.yaml') == 'unrecognized arguments: b.yaml (see simulator --help)'


@pytest.mark.parametrize('arguments', [('-p', 'rate'), ('-r', '__node:=1 bad'), ('--params-file', '/no/such')])
def test_bad_ros_arguments_are_a_refusal(arguments):
    code, output = run(NODE, '--ros-args', *arguments)
    assert code == 2 and 'Traceback' not in output
    assert output.splitlines()[-1].startswith('simulator: ')  # before it, ROS has said its own


@pytest.mark.parametrize('text, sentence', [
    ('', 'is empty'),
    ('name: a\nbodeis: []\n', "'bodeis'"),
    ('bodies: [{name: a, carrier: base, mass: .nan, inertia: 1, rotation: {joint: j}}]', 'nan'),
    ('bodies: [{name: a, carrier: base, mass: 1, rotation: {joint: j}}]', 'inertia')])
def test_a_bad_chain_file_is_one_sentence(text, sentence, tmp_path):
    (tmp_path / 'bad.yaml').write_text(text)
    assert sentence in refusal('--ros-args', '-p', f'chain_file:={tmp_path / "bad.yaml"}')


@pytest.mark.parametrize('program', ['node', 'replay'])
def test_without_ros_it_says_so(program, tmp_path):
    log = tmp_path / 'run.mcap'
    assert rollout([str(CONFIG / 'four_link_robot.yaml'), '--duration', '0.01', '--output', str(log)]) == 0
    blocked = (f"import sys; sys.modules['rclpy'] = None; from planar_chain_sim.ros.{program} import main; "
               f'sys.exit(main({[str(log)] if program == "replay" else []}))')
    ended = subprocess.run([sys.executable, '-c', blocked], capture_output=True, text=True, timeout=PATIENCE)
    assert ended.returncode == 2
    assert 'ROS 2 cannot be loaded' in ended.stderr and ended.stderr.count('\n') == 1


def test_help_has_an_example():
    code, output = run(NODE, '--help')
    assert code == 0 and 'example:\n  simulator seven_link_arm.yaml --ros-args' in output


def test_a_full_disk_ends_it_with_one_sentence(tmp_path):
    def limit():
        resource.setrlimit(resource.RLIMIT_FSIZE, (8_000_000, 8_000_000))
    path = tmp_path / 'run.mcap'
    with simulator(ready=False, chain_file='chain_32_links.yaml', rate=5000, record=path, on_log_failure='stop',
                   preexec_fn=limit) as process:
        assert process.finish() == 2
    assert process.lines[-1] == f"simulator: log '{path}': writing stopped, File too large"
    assert 'Traceback' not in process.output
    log = read_log(path)
    assert not log.complete and sum(1 for _ in log.messages) > 1000


def test_a_step_that_is_too_long_is_warned_of_while_it_runs():
    """RK4 at 10 Hz is stable on the double pendulum and ends half a radian off."""
    with simulator(chain_file='double_pendulum.yaml', method='rk4', rate=10.0, real_time_factor=4.0) as process:
        process.wait_for("too long for method 'rk4': at tick ")


def test_a_stop_signal_in_the_midst_of_a_tick_without_end(tmp_path):
    """A tick of 400 joints for a second takes minutes; what was done before it is in the log, and runs again."""
    links = ''.join(
        f'  - {{name: l{k}, carrier: {f"l{k - 1}" if k else "base"}, origin: [{0.1 if k else 0.0}, 0.0], mass: 1.0, '
        f'center_of_mass: [0.05, 0.0], inertia_com: 0.001, rotation: {{joint: j{k}, '
        f'position: {0.3 if k % 2 else -0.2}, damping: 0.001}}}}\n' for k in range(400))
    chain, path = tmp_path / 'long.yaml', tmp_path / 'run.mcap'
    chain.write_text(f'name: long\nbodies:\n{links}')
    with simulator(chain_file=chain, method='rodas5p', rate=1.0, tolerance=1e-13, record=path) as process:
        time.sleep(3.0)   # the first tick begins after one
        assert process.stop() == 0, process.output   # which waits for a minute, and the tick would take several
    assert read_log(path).complete
    code, output = run('planar_chain_sim.resimulation.command_line', path)
    assert code == 0, output


@pytest.mark.parametrize('arguments, meant', [
    (('-p', 'x:=y'), 'simulator --ros-args -p x:=y'),
    (('rate:=500.0',), 'simulator --ros-args -p rate:=500.0'),
    (('joint_states:=/a', '--ros-args', '-p', 'rate:=5.0'), 'simulator --ros-args -r joint_states:=/a -p rate:=5.0'),
    (('arm.yaml', '--params-file', 'p.yaml'), 'simulator arm.yaml --ros-args --params-file p.yaml'),
    (('-r', '__ns:=/left', 'my.yaml'), 'simulator my.yaml --ros-args -r __ns:=/left'),
    (('rate:=5.0', 'my.yaml', '--hold', 'a=1', '-p', 'lockstep:=true', '__ns:=/l', '--ros-args', '-r', 'a:=b'),
     'simulator my.yaml --hold a=1 --ros-args -p rate:=5.0 -p lockstep:=true -r __ns:=/l -r a:=b')])
def test_ros_arguments_in_the_wrong_place_are_told_what_to_type(arguments, meant):
    assert refusal(*arguments).endswith(f'is for ROS, whose arguments come after --ros-args: {meant}')


@pytest.mark.parametrize('arguments', [
    ('double_pendulum.yaml',), ('double_pendulum.yaml', '--ros-args', '-p', 'rate:=500.0'),
    ('--ros-args', '-p', 'rate:=500.0', '--', 'double_pendulum.yaml'),
    ('--ros-args', '-p', 'chain_file:=double_pendulum.yaml')])
def test_a_chain_file_may_be_named_on_the_command_line(arguments):
    with Process(NODE, *arguments) as process:
        line = process.wait_for('running')
        assert process.stop() == 0, process.output
    assert 'running double_pendulum: joints ' in line
    assert ('500 Hz' in line) == (len(arguments) > 2 and 'rate:=500.0' in arguments)


def test_two_chain_files_are_one_too_many():
    assert refusal('a.yaml', '--ros-args', '-p', 'chain_file:=b.yaml') == (
        "chain_file is given twice, as 'a.yaml' and by the parameter, 'b.yaml': give it once")


def test_the_first_lines_say_what_runs_where_to_send_and_how_to_see_it():
    with simulator('__ns:=/left', '__node:=arm', '~/commands:=/torques', chain_file='double_pendulum.yaml',
                   method='rk4') as process:
        process.wait_for('see it')
        assert process.stop() == 0
    first, second, third = [line.partition(']: ')[2] for line in process.lines[:3]]
    assert first == 'running double_pendulum: joints upper_joint, lower_joint; 1000 Hz, method rk4'
    assert '/torques (' in second and '/left/arm/joint_commands (' in second and '/left/joint_states' in third


def test_inner_matters_are_told_at_debug_level():
    with Process(NODE, '--ros-args', '--log-level', 'simulator:=debug') as process:
        assert 'form dense' in process.wait_for('[DEBUG]')
        assert process.stop() == 0


@pytest.mark.parametrize('columns', ['80', '120'])
def test_help_has_the_table_of_parameters(columns):
    code, output = run(NODE, '--help', env=dict(os.environ, COLUMNS=columns))
    lines = output.splitlines()
    assert code == 0 and max(map(len, lines)) <= int(columns)
    for row in PARAMETERS:
        place = next(place for place, line in enumerate(lines) if line.startswith(f'{row.name} '))
        assert (' yes' in lines[place]) == row.live and row.unit in lines[place]
        meaning = ' '.join(line.strip() for line in lines[place + 1:place + 16])
        assert meaning.startswith(' '.join(row.description.split()))
        if not row.of_chain and row.default != '':
            assert str(row.default).lower() in lines[place].lower()


def test_help_needs_no_ros():
    blocked = f"import sys; sys.modules['rclpy'] = None; from {NODE} import main; sys.exit(main(['--help']))"
    ended = subprocess.run([sys.executable, '-c', blocked], capture_output=True, text=True, timeout=PATIENCE)
    assert ended.returncode == 0 and 'real_time_factor' in ended.stdout


def test_a_sighup_that_nohup_lets_pass_is_let_pass(tmp_path):
    def ignore():
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with simulator(preexec_fn=ignore, record=tmp_path / 'run.mcap') as process:
        process.send(signal.SIGHUP)
        with pytest.raises(subprocess.TimeoutExpired):
            process.popen.wait(2.0)
        assert process.stop() == 0


def test_a_bug_shows_its_traceback(capsys):
    """Only what a user can mend is a sentence: a ValueError of ours is not."""
    def fall(own, ros, stop):
        raise ValueError('of ours')
    handlers = {number: signal.getsignal(number) for number in STOPS}
    try:
        assert run_until_stopped('simulator', fall, []) == 2
    finally:
        for number, handler in handlers.items():
            signal.signal(number, handler)
    assert 'Traceback' in capsys.readouterr().err
