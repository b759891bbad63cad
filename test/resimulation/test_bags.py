"""resimulate reads bags of the node: changes are put back at the ticks at which they were."""
import json
from pathlib import Path
from random import Random
import shutil

import numpy as np
from oracles.random_runs import random_plan, write_plan
from oracles.random_trees import random_tree
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording.cdr import (
    decode_joint_state,
    encode_float64_multi_array,
    encode_string,
    JointStateLayout,
)
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.resimulation import command_line as resimulation

pytest.importorskip('rosbags')
from oracles.bags import CompressionMode, StoragePlugin, write_bag  # noqa: E402, I100

START = 1_700_000_000_000_000_000   # ns, when the node begins
STATES, EVENTS, DESCRIPTION = '/arm/joint_states', '/arm/simulator/events', '/arm/robot_description'
COMMANDS = '/arm/simulator/commands'
TYPES = {STATES: 'sensor_msgs/msg/JointState', EVENTS: 'std_msgs/msg/String', DESCRIPTION: 'std_msgs/msg/String',
         COMMANDS: 'std_msgs/msg/Float64MultiArray'}
PENDULUM = 'double_pendulum.yaml'


def published(log, period=1_000_000, stamps=START, every=1, late=lambda: 0.0, stop=None):
    """
    Return (topic, received, bytes) of what the node publishes of a run that a log has.

    `period`: ns of wall time between two ticks; `stamps`: of tick 0; `every`: ticks between two states; `late()`: how
    much later a message comes, in ticks; `stop`: (tick, ns) of a pause, during which the state is repeated.
    """
    said, last, twice = [], -1, False
    for message in read_log(log).messages:
        if message.topic == '/joint_states':
            tick, twice = message.sequence, message.sequence == last
            last = tick
            paused = stop[1] if stop and tick > stop[0] else 0
            now = stamps + tick * period + paused
            state = decode_joint_state(message.data)
            layout = JointStateLayout(state.names)
            layout.position[:], layout.velocity[:], layout.effort[:] = state.position, state.velocity, state.effort
            if tick % every == 0 or twice:
                said.append((STATES, now + round((0.05 * twice + late()) * period), layout.stamped(now)))
            if stop and tick == stop[0]:
                said += [(STATES, now + k * period, layout.stamped(now)) for k in range(1, stop[1] // period)]
        else:
            event = json.loads(message.data[8:-1])
            tick = event['tick'] + (1.1 if event['kind'] in ('command', 'stop_touched') else 0.02)
            paused = stop[1] if stop and tick > stop[0] else 0
            said.append((EVENTS, round(stamps + (tick + late()) * period) + paused, message.data))
    newest = {}   # messages of one topic do not overtake one another
    for k, (topic, received, data) in enumerate(said):
        newest[topic] = max(received, newest.get(topic, 0) + 1)
        said[k] = topic, newest[topic], data
    return said


def asked(capsys, path, *arguments):
    """Return exit code, answer, and all that resimulate says."""
    code = resimulation.main([str(path), *map(str, arguments)])
    said = capsys.readouterr()
    return code, (said.out.splitlines() or [''])[-1], said.out + said.err


@pytest.mark.parametrize('seed', range(30))
def test_a_random_run_is_found_again(tmp_path, capsys, seed):
    """Messages that come late, are lost or missing at the start; another pace, a pause; of every tick or of some."""
    random, rng, chain = Random(seed), np.random.default_rng(seed), random_tree(seed, 1 + seed % 3)
    (tmp_path / 'chain.yaml').write_text(chain.source)
    plan = [each for each in random_plan(random, rng, chain, 200) if each[1] != 'state']
    plan += [(tick, 'effort', rng.normal(size=chain.joint_count)) for tick in random.sample(range(50, 190), 4)]
    plan.sort(key=lambda each: each[0])
    log = write_plan(tmp_path / 'run.mcap', pcs.Simulation(chain), plan)
    every = random.choice([1, 1, 2, 5])
    simulated = random.random() < 0.3
    stop = None if simulated or every > 1 or random.random() < 0.4 else (random.randrange(60, 140), 37_400_000)
    said = published(log, random.choice([1_000_000, 1_000_000, 2_500_000]) if not simulated else 1_000_000,
                     0 if simulated else START, every, lambda: random.uniform(0.0, 0.3),
                     stop)
    begin = random.randrange(0, 40)
    states = sorted((each for each in said if each[0] == STATES), key=lambda each: each[1])[begin // every:]
    lost = set(random.sample(range(2, len(states) - 2), 3)) if random.random() < 0.5 else ()
    states = [each for k, each in enumerate(states) if k not in lost]
    bag = write_bag(tmp_path / 'bag', TYPES, [*states, *(each for each in said if each[0] == EVENTS)],
                    *random.choice([(StoragePlugin.SQLITE3, CompressionMode.NONE),
                                    (StoragePlugin.MCAP, CompressionMode.NONE),
                                    (StoragePlugin.MCAP, CompressionMode.STORAGE)]))
    code, answer, words = asked(capsys, bag, '--chain', tmp_path / 'chain.yaml', '--threshold', 1e-6)
    assert code == 0 and answer.startswith('It is repeated'), words


@pytest.fixture(scope='module')
def log(tmp_path_factory):
    """Return the log of a run with commands and a reset."""
    path = tmp_path_factory.mktemp('log') / 'run.mcap'
    with pcs.OfflineLog(path, pcs.Simulation(pcs.load_chain(PENDULUM))) as log:
        log.advance(103, [1.0, 0.0])
        log.advance(70, [-3.0, 1.0])
        log.change('reset')
        log.advance(60)
        log.advance(100, [0.0, 2.0])
    return path


def test_without_events_efforts_and_resets_are_those_of_the_states(log, tmp_path, capsys):
    states = [each for each in published(log) if each[0] == STATES]
    bag = write_bag(tmp_path / 'bag', TYPES, states)
    code, answer, words = asked(capsys, bag, '--chain', PENDULUM, '--threshold', 1e-9)
    assert code == 0 and 'has no events of the node: efforts and resets are those that the states show.' in words
    code, answer, words = asked(capsys, bag, '--chain', PENDULUM, '--set', 'lower_rod.mass=0.5')
    assert code == 0 and answer.startswith('Yes, it matters: from t = 0.')
    assert 'Changed: lower_rod.mass 1 -> 0.5' in words


def test_of_thinned_states_commands_tell_when_they_acted(tmp_path, capsys):
    log = tmp_path / 'run.mcap'
    with pcs.OfflineLog(log, pcs.Simulation(pcs.load_chain(PENDULUM))) as run:
        for effort in ([0.0, 0.0], [5.0, 0.0], [-5.0, 3.0]):
            run.advance(103, effort)
    states = [each for each in published(log, every=10) if each[0] == STATES]
    commands = [(COMMANDS, START + tick * 1_000_000 + 300_000, encode_float64_multi_array(effort))
                for tick, effort in ((103, [5.0, 0.0]), (206, [-5.0, 3.0]))]
    with_commands = write_bag(tmp_path / 'with', TYPES, states + commands)
    code, answer, words = asked(capsys, with_commands, '--chain', PENDULUM, '--threshold', 1e-8)
    assert code == 0 and 'that the states show, at the times of commands.' in words
    without = write_bag(tmp_path / 'without', TYPES, states)
    assert asked(capsys, without, '--chain', PENDULUM, '--threshold', 1e-8)[0] == 1


def test_the_chain_can_be_that_of_robot_description(log, tmp_path, capsys):
    said = [*published(log), (DESCRIPTION, START - 5, encode_string(pcs.urdf_of(pcs.load_chain(PENDULUM))))]
    code, answer, words = asked(capsys, write_bag(tmp_path / 'bag', TYPES, said))
    assert code == 0 and f'The chain is the URDF on {DESCRIPTION}, which lacks what URDF cannot describe' in words


def test_a_bag_that_is_not_repeated_is_exit_1(log, tmp_path, capsys):
    lighter = pcs.load_chain(PENDULUM).with_parameters({'lower_rod.mass': 0.7})
    (tmp_path / 'lighter.yaml').write_text(lighter.source)
    bag = write_bag(tmp_path / 'bag', TYPES, published(log))
    code, answer, words = asked(capsys, bag, '--chain', tmp_path / 'lighter.yaml', '--picture', tmp_path / 'a.svg')
    assert code == 1 and answer.startswith('It is not repeated: from t = 0.')
    assert (tmp_path / 'a.svg').read_bytes()[:5] == b'<?xml'


def test_a_bag_in_pieces_or_torn(log, tmp_path, capsys):
    said = published(log)
    bag = write_bag(tmp_path / 'bag', TYPES, [each for each in said if each[1] < START + 150_000_000],
                    compression=CompressionMode.NONE)
    rest = write_bag(tmp_path / 'rest', TYPES, [each for each in said if each[1] >= START + 150_000_000])
    shutil.move(rest / 'rest.mcap', bag / 'bag_10.mcap')
    shutil.move(bag / 'bag.mcap', bag / 'bag_9.mcap')
    (bag / 'metadata.yaml').unlink()          # as after a kill -9 of the recorder
    code, answer, words = asked(capsys, bag, '--chain', PENDULUM)
    assert code == 0 and ': 335 states of double_pendulum' in words
    content = (bag / 'bag_10.mcap').read_bytes()
    (bag / 'bag_10.mcap').write_bytes(content[:-100])
    code, answer, words = asked(capsys, bag, '--chain', PENDULUM)
    assert code == 0 and 'The file was not closed properly, only its whole chunks were compared.' in words


def test_a_log_in_the_folder_of_a_bag_is_compared_bit_for_bit(log, tmp_path, capsys):
    (tmp_path / 'bag').mkdir()
    shutil.copy(log, tmp_path / 'bag' / 'run.mcap')
    assert asked(capsys, tmp_path / 'bag')[1] == 'equal: 335 states over 333 ticks, bit for bit'


@pytest.mark.parametrize('change, arguments, sentence', [
    (lambda said: said, [], 'it holds no robot_description, so give its chain file with --chain'),
    (lambda said: said, ['--chain', 'four_link_robot.yaml'], 'it holds no states of the joints column_slide, '),
    (lambda said: [each for each in said if each[0] == EVENTS], ['--chain', PENDULUM], 'it holds no states of the'),
    (lambda said: [*said, *(('/other/joint_states', *each[1:]) for each in said if each[0] == STATES)],
     ['--chain', PENDULUM],
     'it holds states of these joints on /arm/joint_states, /other/joint_states, must hold them on one topic'),
    (lambda said: said[:1], ['--chain', PENDULUM], 'it holds fewer than two states with different stamps'),
    (lambda said: [*said, (EVENTS, START, encode_string('{]'))], ['--chain', PENDULUM], 'one of its events cannot be'),
    (lambda said: [*said, (STATES, START, said[0][2][:-9])], ['--chain', PENDULUM], 'cannot be used'),
    (lambda said: [*said, (STATES, START + 10**9, said[0][2])], ['--chain', PENDULUM], 'the stamps of its states go'),
    (lambda said: [(topic, received, data[:4] + bytes([k % 251, 0, 0, 0]) + data[8:] if topic == STATES else data)
                   for k, (topic, received, data) in enumerate(said)], ['--chain', PENDULUM], 'stamps'),
    (lambda said: said, ['--chain', PENDULUM, '--step', '0.0003123'], '--step is 0.0003123 s, must be one whose ticks'),
    (lambda said: said, ['--chain', PENDULUM, '--method', 'rk4', '--tolerance', '1e-3'], '--tolerance is for adaptive'),
    (lambda said: said, ['--chain', PENDULUM, '--set', 'lower_rod.masss=1'], "(did you mean 'lower_rod.mass'?)"),
])
def test_a_bag_that_cannot_be_followed_is_one_sentence(log, tmp_path, capsys, change, arguments, sentence):
    types = {**TYPES, '/other/joint_states': TYPES[STATES]}
    bag = write_bag(tmp_path / 'bag', types, change(published(log)))
    code, answer, words = asked(capsys, bag, *arguments)
    assert code == 2 and words.count('\n') == 1 and words.startswith('resimulate: ') and sentence in words, words


def test_files_that_are_no_bag_are_one_sentence(log, tmp_path, capsys):
    said = published(log)
    packed = write_bag(tmp_path / 'packed', TYPES, said, compression=CompressionMode.MESSAGE)
    bag = write_bag(tmp_path / 'bag', TYPES, said, StoragePlugin.SQLITE3, CompressionMode.NONE)
    (tmp_path / 'empty').mkdir()
    broken = Path(shutil.copytree(bag, tmp_path / 'broken'))
    (broken / 'metadata.yaml').write_text('rosbag2_bagfile_information: 3')
    torn = Path(shutil.copytree(bag, tmp_path / 'torn'))
    (torn / 'torn.db3').write_bytes((bag / 'bag.db3').read_bytes()[:3000])
    (torn / 'metadata.yaml').unlink()
    (torn / 'bag.db3').unlink()
    for path, sentence in (
            (packed, 'it was recorded with --compression-mode message, which is not read'),
            (tmp_path / 'empty', 'the folder holds no .mcap or .db3 file'),
            (broken, 'its metadata.yaml cannot be read'),
            (torn, 'it cannot be read as a bag of SQLite'), (tmp_path / 'no.db3', 'it cannot be read')):
        code, answer, words = asked(capsys, path, '--chain', PENDULUM)
        assert code == 2 and words.count('\n') == 1 and sentence in words, words
    assert asked(capsys, bag / 'bag.db3', '--chain', PENDULUM)[0] == 0


@pytest.mark.ros
def test_without_events_a_wrench_acts_from_the_last_state_before_it(tmp_path, capsys):
    """Of three messages the node refused two."""
    from geometry_msgs.msg import WrenchStamped
    from rclpy.serialization import serialize_message
    log, topic = tmp_path / 'run.mcap', '/arm/simulator/wrench'
    with pcs.OfflineLog(log, pcs.Simulation(pcs.load_chain(PENDULUM))) as run:
        run.advance(40)
        run.change('wrench', body='lower_rod', force=[3.0, -1.0], moment=0.5)
        run.advance(100)
    said = [each for each in published(log) if each[0] == STATES]
    for body, force in (('lower_rod', 3.0), ('hand', 1.0), ('upper_rod', float('inf'))):
        push = WrenchStamped()
        push.header.frame_id, push.wrench.force.x, push.wrench.force.y, push.wrench.torque.z = body, force, -1.0, 0.5
        said.append((topic, START + 40_400_000, serialize_message(push)))
    bag = write_bag(tmp_path / 'bag', {**TYPES, topic: 'geometry_msgs/msg/WrenchStamped'}, said)
    code, answer, words = asked(capsys, bag, '--chain', PENDULUM, '--threshold', 1e-9)
    assert code == 0 and 'wrenches act from the last state before them on.' in words, words
