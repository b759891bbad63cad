"""The executable `simulator` as a process: how it ends, and what it says to a user's mistake."""
import os
from pathlib import Path
import random
import resource
import signal
import subprocess
import sys
import time

from live import CONFIG, PATIENCE, run, simulator
import pytest

from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.rollout import main as rollout

NODE = 'planar_chain_sim.ros.node'
STOPS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
TRIALS = int(os.environ.get('SOAK', 3))  # `make soak` wants more


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
    return process


@pytest.mark.parametrize('number', STOPS)
@pytest.mark.parametrize('trial', range(TRIALS))
def test_a_stop_signal_is_a_clean_end(number, trial, tmp_path):
    with simulator(record=tmp_path / 'run.mcap') as process:
        assert process.stop(number) == 0
    assert 'running' in process.lines[0] and 'send efforts to' in process.lines[1] and 'see it' in process.lines[2]
    assert [line for line in process.lines[3:] if 'late and dropped' not in line] == []   # a busy machine may be late
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
    ended = subprocess.run([sys.executable, '-c', blocked], capture_output=True, text=True)
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


@pytest.mark.parametrize('number', STOPS)
def test_a_stop_signal_in_the_midst_of_a_tick_without_end(number, tmp_path):
    """A tick of 400 joints for a second takes minutes; what was done before it is in the log, and runs again."""
    links = ''.join(
        f'  - {{name: l{k}, carrier: {f"l{k - 1}" if k else "base"}, origin: [{0.1 if k else 0.0}, 0.0], mass: 1.0, '
        f'center_of_mass: [0.05, 0.0], inertia_com: 0.001, rotation: {{joint: j{k}, '
        f'position: {0.3 if k % 2 else -0.2}, damping: 0.001}}}}\n' for k in range(400))
    chain, path = tmp_path / 'long.yaml', tmp_path / 'run.mcap'
    chain.write_text(f'name: long\nbodies:\n{links}')
    with simulator(chain_file=chain, method='rodas5p', rate=1.0, tolerance=1e-13, record=path) as process:
        time.sleep(3.0)   # the first tick begins after one
        began = time.monotonic()
        assert process.stop(number) == 0, process.output
        assert time.monotonic() - began < 20.0
    assert read_log(path).complete
    code, output = run('planar_chain_sim.recording.resimulation', path)
    assert code == 0, output
