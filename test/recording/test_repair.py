"""repair: what a kill, a full disk or a power cut left of a log becomes a finished log that every reader takes."""
import os
from random import Random
import re
import subprocess
import sys

from mcap.reader import make_reader
import numpy as np
from oracles.container import check_container
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording import repair
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogWriter
from planar_chain_sim.recording.mcap_file import McapFile
from planar_chain_sim.recording.repair import repair_log
from planar_chain_sim.recording.rosbag2_profile import Channel
from planar_chain_sim.resimulation.bits import resimulate

PENDULUM = pcs.load_chain('double_pendulum.yaml')
TICKS = 200


def write(path, compression='none'):
    """Write a log with a change of effort now and then, a chunk for each 40 messages."""
    original = path.with_name('original.mcap')
    with pcs.OfflineLog(original, pcs.Simulation(PENDULUM)) as log:
        log.advance(TICKS, np.repeat(np.random.default_rng(1).normal(size=(TICKS // 10, 2)), 10, axis=0))
    old = read_log(original)
    channels = [Channel('/joint_states', 'sensor_msgs/msg/JointState'),
                Channel('/simulator/events', 'std_msgs/msg/String')]
    with LogWriter(path, channels, {'chain.yaml': old.chain_text.encode()}, {'planar_chain_sim': old.settings},
                   compression=compression) as writer:
        for k, message in enumerate(old.messages):
            writer.write(message.topic, message.data, message.log_time, message.publish_time, message.sequence)
            if k % 40 == 39:
                writer.flush()
    original.unlink()
    return path


@pytest.fixture(scope='module', params=['none', 'lz4', 'zstd'])
def compressed(request, tmp_path_factory):
    """Return a finished log."""
    return write(tmp_path_factory.mktemp('log') / 'run.mcap', request.param)


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """Return a finished log without compression, and where each of its states ends."""
    path = write(tmp_path_factory.mktemp('log') / 'run.mcap')
    data = path.read_bytes()
    return path, [data.index(message.data) + len(message.data) for message in read_log(path).messages
                  if message.topic == '/joint_states']


def chunks_of(path):
    """Return the place and the length of each chunk's record."""
    with open(path, 'rb') as file:
        indexes = make_reader(file).get_summary().chunk_indexes
    return [(index.chunk_start_offset, index.chunk_length) for index in indexes]


def repaired(torn):
    """Repair a log in place of an earlier one; return its messages, the file being checked, and what was found."""
    output = torn.with_name('out.mcap')
    output.unlink(missing_ok=True)
    before = torn.read_bytes()
    found, written = repair_log(torn, output)
    assert written and torn.read_bytes() == before
    messages = list(read_log(output).messages)
    assert [(message.topic, message.log_time) for message in messages] == check_container(output)
    verdict = resimulate(read_log(output))
    assert verdict.difference is None and verdict.states == found.states
    assert found.time == pytest.approx(verdict.ticks * 1e-3, abs=1e-12)
    return messages, found


def test_a_log_cut_anywhere_loses_no_whole_state(tmp_path, whole):
    """By a kill, or by a full disk."""
    path, ends = whole
    messages, data, random = list(read_log(path).messages), path.read_bytes(), Random(1)
    begin, end = chunks_of(path)[0][0], len(data) - 1
    cuts = [random.randint(begin + 2000, end) for _ in range(40)]
    cuts += [place + offset for place, length in chunks_of(path)[1:3] for offset in (0, 5, 9, 40, 57, 60, length)]
    torn = tmp_path / 'torn.mcap'
    for cut in sorted({*cuts, end, begin + 2000}):
        torn.write_bytes(data[:cut])
        read, found = repaired(torn)
        assert read == messages[:len(read)]
        there = sum(place <= cut for place in ends)
        assert there - 1 <= found.states <= there   # the last one may end in zeros, which a disk can have made up
        assert 0 <= found.lost < 400 or found.lost_time == 0.0   # of a message, or what stands behind messages
        assert found.damage == ''


def test_a_power_cut_leaves_zeros(tmp_path, whole):
    """In whole sectors, or to the end of a file that had become longer already."""
    path, ends = whole
    data, random, torn = path.read_bytes(), Random(2), tmp_path / 'torn.mcap'
    places = chunks_of(path)
    begin = places[0][0] + 2500
    for _ in range(20):
        cut = random.randint(begin, len(data) - 1)
        torn.write_bytes(data[:cut] + bytes(random.choice([1, 3, 8, 100, 512, 5000])))
        states = repaired(torn)[1].states
        assert sum(place <= cut for place in ends) - 1 <= states <= sum(place <= cut + 8 for place in ends)
    os.truncate(torn, 10**9)   # all of it holes
    assert repaired_quickly(torn).states >= states
    for place, length in places[1:]:
        hole = (place + 512 + random.randrange(length - 1024)) // 512 * 512
        torn.write_bytes(data[:hole] + bytes(512) + data[hole + 512:])
        _, found = repaired(torn)
        there = sum(end <= hole for end in ends)
        assert there - 1 <= found.states <= there and str(torn) in found.damage
        assert found.lost_time == pytest.approx((TICKS + 1 - found.states) * 1e-3, abs=1.5e-3)


def repaired_quickly(torn):
    torn.with_name('out.mcap').unlink()
    return repair_log(torn, torn.with_name('out.mcap')).found


def test_a_compressed_log_is_kept_up_to_its_last_whole_chunk(tmp_path, compressed):
    data, places, torn = compressed.read_bytes(), chunks_of(compressed), tmp_path / 'torn.mcap'
    for place, length in places[1:]:
        torn.write_bytes(data[:place + length - 1])
        _, found = repaired(torn)
        assert found.lost < length
    last = repaired(torn)
    torn.write_bytes(data[:place + length])   # without its index
    assert len(repaired(torn)[0]) > len(last[0])
    assert compressions(torn.with_name('out.mcap')) == compressions(compressed)


def compressions(path):
    with open(path, 'rb') as file:
        return {index.compression for index in make_reader(file).get_summary().chunk_indexes}


def test_a_flipped_bit_is_never_kept(tmp_path, whole):
    """
    Wherever it is in a whole chunk or behind it; a log that is finished is read to its end to find it.

    In a chunk that was cut it would be kept: that has no check sum.
    """
    path, _ = whole
    messages, data, random = list(read_log(path).messages), path.read_bytes(), Random(3)
    places, torn, refused = chunks_of(path), tmp_path / 'torn.mcap', 0
    for _ in range(40):
        damaged, last = bytearray(data), random.choice([3, len(places)])
        end = places[3][0] if last == 3 else len(data)
        damaged[random.randrange(places[0][0], end)] ^= 1 << random.randrange(8)
        torn.write_bytes(damaged[:end + (100 if last == 3 else 0)])
        torn.with_name('out.mcap').unlink(missing_ok=True)
        try:
            found, written = repair_log(torn, torn.with_name('out.mcap'))
        except pcs.LogError as error:
            refused += 1   # in the first chunk: no state is whole
            assert 'no whole state' in str(error) or 'no chunk' in str(error), error
            assert not torn.with_name('out.mcap').exists()
        else:
            if written:
                read, _ = repaired(torn)
                assert read == messages[:len(read)]
    assert refused < 20


def test_chunks_that_come_twice_or_are_missing(tmp_path, whole):
    """What is kept goes on from tick to tick."""
    path, _ = whole
    messages, data, torn = list(read_log(path).messages), path.read_bytes(), tmp_path / 'torn.mcap'
    (second, _), (third, _), (fourth, _), *_ = chunks_of(path)[1:]
    for pieces in ((data[:third], data[second:third], data[third:-300]), (data[:third], data[fourth:-300])):
        torn.write_bytes(b''.join(pieces))
        read, found = repaired(torn)
        assert read == messages[:80] and 'does not follow tick' in found.damage and found.lost > fourth - third


def test_a_cut_chunk_with_nonsense_in_it(tmp_path, whole):
    """It has no check sum; what cannot be decoded is not kept."""
    path, ends = whole
    messages, data, torn = list(read_log(path).messages), path.read_bytes(), tmp_path / 'torn.mcap'
    for missing in (1, 37):
        torn.write_bytes(data[:ends[50] - 60] + data[ends[50] - 60 + missing:ends[70]])
        read, found = repaired(torn)
        assert read == messages[:len(read)] and found.states == 50


def test_bag_information_that_is_damaged_is_left_out(tmp_path, whole):
    data, torn = whole[0].read_bytes()[:-100], tmp_path / 'torn.mcap'
    torn.write_bytes(data.replace(b'topics_with', b'Topics with'))
    assert repair_log(torn, tmp_path / 'out.mcap').found.states == TICKS + 1
    assert b'opics' not in (tmp_path / 'out.mcap').read_bytes() and read_log(tmp_path / 'out.mcap').complete


def test_a_log_of_others_is_refused_at_its_first_chunk(tmp_path):
    with open(tmp_path / 'bag.mcap', 'wb') as stream:
        mcap = McapFile(stream, 'ros2', 'other')
        mcap.add_channel('/a', 'cdr', mcap.add_schema('std_msgs/msg/String', 'ros2msg', b''), {})
        mcap.chunk.add_message(1, 0, b'', 0, 0)
        mcap.flush()
    with pytest.raises(pcs.LogError, match='no log of planar_chain_sim'):
        repair_log(tmp_path / 'bag.mcap', tmp_path / 'out.mcap')
    assert not (tmp_path / 'out.mcap').exists()


def test_a_finished_log_is_left_as_it_is(tmp_path, compressed, capsys):
    path = tmp_path / 'run.mcap'
    path.write_bytes(compressed.read_bytes())
    assert repair.main([str(path)]) == 0
    assert 'run.mcap: nothing to repair, it is finished and its 201 states are whole' in capsys.readouterr().out
    assert list(tmp_path.iterdir()) == [path]


def test_the_command_says_what_was_lost(tmp_path, whole, capsys):
    path, data = tmp_path / 'run.mcap', whole[0].read_bytes()
    place, length = chunks_of(whole[0])[3]
    path.write_bytes(data[:place + length // 2])
    assert repair.main([str(path)]) == 0
    said, said_to_err = capsys.readouterr()
    assert said.startswith(f'{tmp_path}/run.repaired.mcap: 1') and said.count('\n') == 1 and not said_to_err
    assert ' states up to t = 0.1' in said
    assert re.search(r'; lost: the last \d+ bytes of run.mcap, 0.0\d+ s of the recording$', said.strip())
    assert pcs.load_log(tmp_path / 'run.repaired.mcap').complete
    assert repair.main([str(path)]) == 2
    assert "run.repaired.mcap': the file exists and is not overwritten, give a new name" in capsys.readouterr().err
    flipped = bytearray(data)
    flipped[place + length - 10] ^= 1
    path.write_bytes(flipped)
    assert repair.main([str(path), '--output', str(tmp_path / 'new.mcap')]) == 0
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 2 and 'what follows the first damage is not used' in said[1] and 'check sum' in said[1]


def test_nothing_whole(tmp_path, whole):
    data, output = whole[0].read_bytes(), tmp_path / 'out.mcap'
    os.mkfifo(tmp_path / 'pipe')
    begin = chunks_of(whole[0])[0][0]
    for name, content, reason in (('empty', b'', 'no MCAP file'), ('text', b'name: chain\n', 'no MCAP file'),
                                  ('magic', data[:8], 'no log of planar_chain_sim'),
                                  ('settings', data[:600], 'no log of planar_chain_sim'),
                                  ('begun', data[:begin], 'no whole state'),
                                  ('explained', data[:begin + 1400], 'no whole state'),
                                  ('zeros', data[:begin] + bytes(5000), 'no whole state'),
                                  ('pipe', None, 'it is no file'), ('', None, 'it is no file'),
                                  ('none', None, 'No such file')):
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(pcs.LogError, match=reason) as caught:
            repair_log(tmp_path / name, output)
        assert '\n' not in str(caught.value) and not output.exists()


def test_an_output_that_cannot_be_written_is_deleted(tmp_path, whole):
    torn = tmp_path / 'torn.mcap'
    torn.write_bytes(whole[0].read_bytes()[:-100])
    code = ('import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000)); '
            'from planar_chain_sim.recording.repair import main; sys.exit(main(sys.argv[1:]))')
    done = subprocess.run([sys.executable, '-c', code, torn, '--output', tmp_path / 'out.mcap'], text=True,
                          env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}, capture_output=True)
    assert done.returncode == 2 and done.stderr.count('\n') == 1 and 'File too large' in done.stderr, done.stderr
    assert list(tmp_path.iterdir()) == [torn]
    with pytest.raises(KeyboardInterrupt):
        repair_log(torn, tmp_path / 'out.mcap', interrupt)
    assert list(tmp_path.iterdir()) == [torn]
    for output, reason in ((tmp_path, 'exists'), (tmp_path / 'no' / 'such', 'No such file'), (torn, 'exists')):
        with pytest.raises(pcs.LogError, match=reason):
            repair_log(torn, output)


def interrupt(size):
    """Behave as if Ctrl-C came while a file is repaired."""
    raise KeyboardInterrupt


def test_rosbags_reads_what_was_repaired(tmp_path, whole):
    highlevel = pytest.importorskip('rosbags.highlevel')
    torn = tmp_path / 'torn.mcap'
    torn.write_bytes(whole[0].read_bytes()[:chunks_of(whole[0])[3][0] + 3000])
    messages, _ = repaired(torn)
    with highlevel.AnyReader([tmp_path / 'out.mcap']) as reader:
        read = [(connection.topic, log_time, bytes(data)) for connection, log_time, data in reader.messages()]
        assert read == [(message.topic, message.log_time, message.data) for message in messages]
        assert sum(connection.msgcount for connection in reader.connections) == len(messages)


def test_a_full_disk_is_blamed_for_the_new_file(tmp_path, whole):
    """With a limit on the size of files, as a full disk would have it."""
    torn = tmp_path / 'torn.mcap'
    torn.write_bytes(whole[0].read_bytes()[:-100])
    limit = torn.stat().st_size // 2
    program = (f'import resource, signal; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); '
               f'resource.setrlimit(resource.RLIMIT_FSIZE, ({limit}, {limit})); '
               f'from planar_chain_sim.recording.repair import main; raise SystemExit(main(["torn.mcap"]))')
    run = subprocess.run([sys.executable, '-c', program], cwd=tmp_path, capture_output=True, text=True,
                         env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)})
    assert (run.returncode, run.stderr) == (
        2, "repair: log 'torn.repaired.mcap': it cannot be written (File too large)\n")
    assert [each.name for each in tmp_path.iterdir()] == ['torn.mcap']
