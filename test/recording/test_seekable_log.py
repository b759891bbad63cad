"""SeekableLog: any place of a log of any size, with bounded work and memory; what is left of one that was cut short."""
import os
from random import Random
import struct
import subprocess
import sys

from hypothesis import given, settings, strategies as st
from mcap.reader import make_reader
import numpy as np
from oracles.container import drawn_damage
from oracles.work import lines_run
import pytest

import planar_chain_sim as pcs
from planar_chain_sim.recording import seekable_log
from planar_chain_sim.recording.log_index import read_index
from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.mcap_file import McapFile
from planar_chain_sim.recording.mcap_records import FRAME
from planar_chain_sim.recording.message_types import MESSAGE_TYPES
from planar_chain_sim.recording.seekable_log import SeekableLog

ROBOT = pcs.load_chain('four_link_robot.yaml')
PENDULUM = pcs.load_chain('double_pendulum.yaml')
PRIVATE = 0x80   # an opcode that every reader skips
STEP = 1e-3


def rechunked(path, copy, per_chunk, gap=0, compression=''):
    """Write the messages of a log in chunks of `per_chunk`, each before a private record of `gap` bytes, a hole."""
    old = read_log(path)
    with open(copy, 'xb') as stream:
        mcap = McapFile(stream, 'ros2', 'test', compression)
        mcap.add_attachment('chain.yaml', 'application/yaml', old.chain_text.encode())
        mcap.add_metadata('planar_chain_sim', old.settings)
        channels, before = {}, None
        for k, message in enumerate(old.messages):
            data = message.data
            if message.topic == '/joint_states':
                if message.sequence == before:   # a second state of its tick: with other efforts, which do not count
                    data = data[:-8] + struct.pack('<d', 1e3)
                before = message.sequence
            if message.topic not in channels:
                definition = MESSAGE_TYPES[message.type_name].definition.encode()
                channels[message.topic] = mcap.add_channel(
                    message.topic, 'cdr', mcap.add_schema(message.type_name, 'ros2msg', definition), {})
            mcap.chunk.add_message(channels[message.topic], message.log_time, data, message.publish_time,
                                   message.sequence)
            if k % per_chunk == per_chunk - 1:
                mcap.flush()
                if gap:
                    stream.write(FRAME.pack(PRIVATE, gap))
                    stream.seek(gap, os.SEEK_CUR)
        mcap.finish()
    return copy


@pytest.fixture(scope='module')
def path(tmp_path_factory):
    """Return a log of 3000 ticks, several chunks, with changes of state, also several at one tick, and resets."""
    path, random = tmp_path_factory.mktemp('log') / 'run.mcap', np.random.default_rng(3)
    with pcs.OfflineLog(path, pcs.Simulation(ROBOT)) as log:
        for _ in range(30):
            log.advance(100, effort=random.normal(size=5))
            for _ in range(random.integers(4)):
                log.change('state', position=random.normal(size=5), velocity=random.normal(size=5))
            if random.random() < 0.3:
                log.change('reset')
    return path


@pytest.fixture(scope='module', params=['as written', 'tiny chunks', 'lz4', 'zstd', 'cut short'])
def kind(request, path, tmp_path_factory):
    """Return the same log, differently written."""
    copy = tmp_path_factory.mktemp('log') / 'copy.mcap'
    if request.param == 'as written':
        return path
    if request.param == 'cut short':
        data = path.read_bytes()
        copy.write_bytes(data[:read_index(path).end + 5])   # not quite to the last bag information
        return copy
    chunks = {'tiny chunks': (2,), 'lz4': (400, 0, 'lz4'), 'zstd': (400, 0, 'zstd')}
    return rechunked(path, copy, *chunks[request.param])


@pytest.mark.filterwarnings('ignore:.*not closed properly')
def test_every_state_and_event_is_that_of_the_whole_log(kind):
    whole = pcs.load_log(kind)
    with SeekableLog(kind) as log:
        assert (log.chain, log.settings, log.complete) == (whole.chain, whole.settings, whole.complete)
        assert (log.first_time, log.last_time, log.tick_count) == (whole.time[0], whole.time[-1], 3000)
        for tick in np.random.default_rng(1).permutation(3001).tolist():
            state = log.state_at(tick * STEP + 0.3 * STEP)
            assert (state.tick, state.time) == (tick, tick * STEP)
            assert state.position.tobytes() == whole.position[tick].tobytes()
            assert state.velocity.tobytes() == whole.velocity[tick].tobytes()
            assert not tick or state.effort.tobytes() == whole.effort[tick - 1].tobytes()
        assert [log.state_at(time).tick for time in (-5.0, 1e9, np.nan, np.inf, -np.inf)] == [0, 3000, 0, 3000, 0]
        assert len(log.events) == len(whole.events) > 50 and list(log.events) == whole.events
        check_events(log, whole.events)


def check_events(log, events):
    random = Random(2)
    for _ in range(100):
        begin, end = sorted(random.uniform(-0.1, 3.1) for _ in range(2))
        first, last, kinds = log.tick_at(begin), log.tick_at(end), random.choice([None, {'reset'}, {'state', 'reset'}])
        within = [event for event in events if first <= event['tick'] <= last]
        assert log.events.between(begin, end) == within and log.events.between(begin, end, 3) == within[:3]
        chosen = [event for event in events if kinds is None or event['kind'] in kinds]
        assert log.events.between(begin, end, kinds=kinds) == [event for event in within if event in chosen]
        assert log.events.next(begin, kinds) == next((event for event in chosen if event['tick'] > first), None)
        assert log.events.previous(begin, kinds) == next((event for event in reversed(chosen)
                                                          if event['tick'] < first), None)


@pytest.mark.filterwarnings('ignore:.*not closed properly')
def test_series_has_the_least_and_the_greatest_values(kind, monkeypatch):
    whole = pcs.load_log(kind)
    monkeypatch.setattr(seekable_log, 'EXACT_CHUNKS', 10_000)
    with SeekableLog(kind) as log:
        for begin, end, count in ((0.0, 3.0, 100), (1.0, 1.05, 500), (2.2, 2.9, 7), (-1.0, 9.0, 1), (1.0, 1.0, 3)):
            first, last = log.tick_at(begin), log.tick_at(end)
            series = log.series(begin, end, count)
            assert series.exact and 0 < len(series.time) <= count and series.low.shape == series.high.shape
            bounds = np.append(np.round(series.time / STEP).astype(int), last + 1)
            assert bounds[0] == first
            for k in range(len(series.time)):
                rows = slice(bounds[k], bounds[k + 1])
                # Positions and velocities before a change at the tick count too: they lie between.
                assert (series.low[0, k] <= whole.position[rows].min(axis=0)).all()
                assert (series.high[1, k] >= whole.velocity[rows].max(axis=0)).all()
        for begin, end in ((2.0, 1.999), (2.0, 1.0), (3.0, 0.0), (9.0, -9.0)):   # from the end to the beginning
            assert log.series(begin, end, 5).low.shape == (3, 0, whole.position.shape[1])
        exact = log.series(0.0, 3.0, 50)
        monkeypatch.setattr(seekable_log, 'EXACT_CHUNKS', 0)
        sampled = log.series(0.0, 3.0, 50)
        assert not sampled.exact and 1 < len(sampled.time) <= 50
        within = np.isin(exact.time, sampled.time)
        assert (sampled.low >= exact.low[:, within]).all() and (sampled.high <= exact.high[:, within]).all()


@pytest.fixture(scope='module')
def ten_gigabytes(tmp_path_factory):
    """Return a log of 10 GB, nearly all holes, in 20000 chunks; beside it its small original."""
    folder, random = tmp_path_factory.mktemp('large'), np.random.default_rng(4)
    with pcs.OfflineLog(folder / 'small.mcap', pcs.Simulation(PENDULUM)) as log:
        log.advance(40_000, np.repeat(random.normal(size=(40, 2)), 1000, axis=0))
    path = rechunked(folder / 'small.mcap', folder / 'large.mcap', 2, 512 * 1024)
    yield path, pcs.load_log(folder / 'small.mcap')
    path.unlink()


def test_a_log_of_ten_gigabytes(ten_gigabytes):
    """The work of each answer is counted, in bytes read and in lines of Python run: both are the same everywhere."""
    path, small = ten_gigabytes
    assert path.stat().st_size > 10e9 and 512 * path.stat().st_blocks < 200e6
    opening = subprocess.run([sys.executable, '-c', OPENING, path], capture_output=True, text=True, check=True,
                             env={**os.environ, 'PYTHONPATH': os.pathsep.join(sys.path)}).stdout.split()
    memory, read = map(int, opening)
    assert memory < 300e6 and read < 50e6
    log, lines = lines_run(lambda: SeekableLog(path))
    assert lines < 30 * 20_000
    with log, open(path, 'rb') as file:
        assert log.complete and log.tick_count == 40_000 and len(log.events) == len(small.events) == 40
        for tick in np.random.default_rng(1).integers(0, 40_001, 40).tolist():
            before = bytes_read()
            state, lines = lines_run(lambda: log.state_at(tick * STEP))
            assert (state.tick, state.position.tobytes()) == (tick, small.position[tick].tobytes())
            assert lines < 10_000 and bytes_read() - before < 1e6
        assert log.events.next(30.0) == small.events[31] and log.events.previous(30.0) == small.events[29]
        series, lines = lines_run(lambda: log.series(0.0, 40.0, 500))
        assert not series.exact and 400 < len(series.time) <= 500 and lines < 200_000
        # A reader by other authors finds the same.
        message, = [each for *_, each in make_reader(file).iter_messages(
            ['/joint_states'], starting_at=35_000_000_000, ending_before=35_001_000_000)]
        assert message.sequence == 35_000
    check_cut_short(path, small)


OPENING = """
import sys
from planar_chain_sim.recording.seekable_log import SeekableLog
log = SeekableLog(sys.argv[1])
for k in range(200):
    log.state_at(40.0 * k / 200)
log.series(0.0, 40.0, 500)
memory, = [line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')]
read, = [line.split()[1] for line in open('/proc/self/io') if line.startswith('rchar')]
print(int(memory) * 1024, read)
"""


def bytes_read():
    """Return the bytes that this process has read from files."""
    with open('/proc/self/io') as file:
        return int(next(line.split()[1] for line in file if line.startswith('rchar')))


def check_cut_short(path, small):
    os.truncate(path, path.stat().st_size // 2)
    before = bytes_read()
    with SeekableLog(path) as log:
        # Two states and an event now and then in 512 KiB, of which only the heads of records are read.
        assert not log.complete and 19_900 < log.last_tick < 20_100 and bytes_read() - before < 10e6
        assert log.state_at(15.0).position.tobytes() == small.position[15_000].tobytes()


@settings(max_examples=150, deadline=2000)   # ms: no damage may make reading slow
@given(data=st.data())
def test_any_damage_is_read_or_refused(tmp_path_factory, small_log, data):
    damaged = drawn_damage(data.draw, small_log)
    path = tmp_path_factory.getbasetemp() / 'damaged.mcap'
    path.write_bytes(damaged)
    try:
        with SeekableLog(path) as log:
            for time in np.linspace(log.first_time, log.last_time, 5).tolist():
                assert log.state_at(time).position.shape == (2,)
                log.events.next(time)
            assert log.series(log.first_time, log.last_time, 10).low.shape[0] == 3
            list(log.events)
    except pcs.LogError as error:
        assert str(path) in str(error) and '\n' not in str(error)


@pytest.fixture(scope='module', params=['', 'lz4', 'zstd'])
def small_log(request, tmp_path_factory):
    """Return the bytes of a short log of several chunks."""
    folder = tmp_path_factory.mktemp('small')
    with pcs.OfflineLog(folder / 'run.mcap', pcs.Simulation(PENDULUM)) as log:
        for effort in range(5):
            log.advance(3, [effort, 0.0])
    return rechunked(folder / 'run.mcap', folder / 'copy.mcap', 5, 0, request.param).read_bytes()


def test_a_chunk_whose_bytes_have_changed_is_not_shown(tmp_path, path):
    data = bytearray(path.read_bytes())
    index = read_index(path)
    middle = int(index.start[0] + index.length[0] // 2)
    data[middle] ^= 0x40
    (tmp_path / 'changed.mcap').write_bytes(data)
    with SeekableLog(tmp_path / 'changed.mcap') as log:
        with pytest.raises(pcs.LogError, match='changed.mcap.*the chunk at byte .* does not match its check sum'):
            log.state_at(log.first_time)


def test_files_that_are_no_logs(tmp_path, path):
    os.mkfifo(tmp_path / 'pipe')
    (tmp_path / 'empty').touch()
    (tmp_path / 'text').write_text('name: chain\n')
    (tmp_path / 'cut').write_bytes(path.read_bytes()[:100])
    with pcs.OfflineLog(tmp_path / 'begun', pcs.Simulation(ROBOT)):
        for name, reason in (('pipe', 'no file'), ('', 'no file'), ('empty', 'no MCAP file'), ('text', 'no MCAP file'),
                             ('cut', 'no log of planar_chain_sim'), ('none', 'No such file'), ('begun', 'no state')):
            with pytest.raises(pcs.LogError, match=f'{name}.*{reason}'):
                SeekableLog(tmp_path / name)
