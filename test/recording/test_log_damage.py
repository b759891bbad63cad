"""What remains of a log after a kill, a full disk, a cut, a flipped bit, or garbage."""
import os
import re
import signal
import struct
import subprocess
import sys
import time

from hypothesis import given, settings, strategies as st
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from oracles.container import drawn_damage
from oracles.work import lines_run
import pytest
from recorded_run import CHAIN_TEXT, CHANNELS, EXTRAS, recorded, write, write_log
import zstandard

from planar_chain_sim.recording.log_reader import read_log
from planar_chain_sim.recording.log_writer import LogError, LogWriter
from planar_chain_sim.recording.mcap_file import CHUNK_SIZE


@pytest.fixture(scope='module')
def finished(tmp_path_factory):
    """Return a finished log of several chunks and the messages in it."""
    messages = recorded(4000)
    return write_log(tmp_path_factory.mktemp('log') / 'run.mcap', messages), messages


def test_a_torn_log_is_read_up_to_its_last_whole_chunk(tmp_path, finished):
    path, messages = finished
    whole = path.read_bytes()
    with open(path, 'rb') as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    ends = [(chunk.chunk_start_offset + chunk.chunk_length, chunk.chunk_start_offset) for chunk in chunks]
    torn = tmp_path / 'torn.mcap'
    per_chunk = [0]
    for end, start in ends:
        for cut in (end - 1, start + 9, start + 5):
            torn.write_bytes(whole[:cut])
            log = read_log(torn)
            assert (len(list(log.messages)), log.complete) == (per_chunk[-1], False)
        torn.write_bytes(whole[:end])
        read = list(read_log(torn).messages)
        assert len(read) > per_chunk[-1] and read == messages[:len(read)]
        per_chunk.append(len(read))
    assert per_chunk[-1] == len(messages)
    torn.write_bytes(whole[:-1])
    assert (list(read_log(torn).messages), read_log(torn).complete) == (messages, False)


def test_a_crashed_file_system_leaves_zeros(tmp_path):
    path = tmp_path / 'run.mcap'
    writer = LogWriter(path, CHANNELS, **EXTRAS)
    write(writer, recorded(20))
    writer.flush()
    work = []
    for size in (path.stat().st_size + 100, path.stat().st_size + 10_000):
        os.truncate(path, size)   # zeros with no data behind them, which nobody may walk through record by record
        messages, lines = lines_run(lambda: list(read_log(path).messages))
        assert messages == recorded(20)
        work.append(lines)
    assert work[0] == work[1]
    os.truncate(path, 10 ** 9)
    assert list(read_log(path).messages) == recorded(20)


def test_a_flipped_bit_of_a_state_is_read_as_it_is(tmp_path, finished):
    path, messages = finished
    data = bytearray(path.read_bytes())
    place = data.index(messages[700].data) + 60
    data[place] ^= 1
    damaged = tmp_path / 'damaged.mcap'
    damaged.write_bytes(data)
    read = list(read_log(damaged).messages)
    assert [index for index, message in enumerate(read) if message != messages[index]] == [700]
    assert len(read) == len(messages)


def refused(path):
    """Return the one sentence in which read_log, or a pass over the messages, refuses a file."""
    with pytest.raises(LogError) as caught:
        list(read_log(path).messages)
    assert str(path) in str(caught.value) and '\n' not in str(caught.value)
    return str(caught.value)


def test_unreadable_files(tmp_path, finished):
    path = tmp_path / 'run.mcap'
    assert 'No such file' in refused(path)
    assert 'it is no file' in refused(tmp_path)
    os.mkfifo(tmp_path / 'pipe')
    assert 'it is no file' in refused(tmp_path / 'pipe')
    for content in (b'', b'\x89MCAP', os.urandom(10_000_000), b'name: chain\n'):
        path.write_bytes(content)
        assert 'no MCAP file' in refused(path)
    whole = finished[0].read_bytes()
    for content in (whole[:8], whole[:60], whole[:8] + os.urandom(1_000_000), whole[:8] + b'\x80' * 1_000_000):
        path.write_bytes(content)
        assert 'no log of planar_chain_sim' in refused(path)
    path.unlink()
    LogWriter(path, CHANNELS, attachments=EXTRAS['attachments']).close()
    assert 'no log of planar_chain_sim' in refused(path)
    path.unlink()
    LogWriter(path, CHANNELS, attachments={'chain.yaml': b'\xff'}, metadata=EXTRAS['metadata']).close()
    assert 'not UTF-8' in refused(path)


def test_damaged_files(tmp_path, finished):
    path, whole = tmp_path / 'run.mcap', finished[0].read_bytes()
    with open(finished[0], 'rb') as file:
        chunk = make_reader(file).get_summary().chunk_indexes[1]
    content = chunk.chunk_start_offset + 9 + 40   # of the second chunk: its first record
    for place, flip, reason in (
            (whole.index(CHAIN_TEXT.encode()), 1, 'check sum'),
            (chunk.chunk_start_offset + 8, 1, 'do not lead to its end'),   # length of the chunk
            (chunk.chunk_start_offset + 25, 1, 'content is not'),          # announced size
            (content + 8, 0x40, 'a record in it is not whole'),                        # length of a message
            (content + 9, 0x40, 'unknown channel')):
        data = bytearray(whole)
        data[place] ^= flip
        path.write_bytes(data)
        assert reason in refused(path)


def with_chunk(path, compression, data, size):
    """Append a chunk to the log that was begun at a path."""
    builder = RecordBuilder()
    records.Chunk(compression, data, 0, 0, 0, size).write(builder)
    LogWriter(path, CHANNELS, **EXTRAS).flush()
    with open(path, 'ab') as file:
        file.write(builder.end())
    return path


def test_a_message_shorter_than_its_own_head(tmp_path):
    content = struct.pack('<BQ', 5, 3) + b'abc'
    assert 'a record in it is not whole' in refused(with_chunk(tmp_path / 'run.mcap', '', content, len(content)))


def test_a_decompression_bomb(tmp_path):
    compressor = zstandard.ZstdCompressor().compressobj(size=2 ** 29)
    bomb = b''.join(compressor.compress(bytes(2 ** 20)) for _ in range(2 ** 9)) + compressor.flush()
    assert len(bomb) < 2 ** 16
    assert 'content is not' in refused(with_chunk(tmp_path / 'run.mcap', 'zstd', bomb, 2 ** 29))


@pytest.mark.parametrize('compression', ['lz4', 'zstd', 'none', 'gzip'])
def test_a_chunk_that_announces_too_much(tmp_path, compression):
    log = write_log(tmp_path / 'run.mcap', recorded(20), compression='none' if compression == 'gzip' else compression)
    data = bytearray(log.read_bytes())
    with open(log, 'rb') as file:
        chunk = make_reader(file).get_summary().chunk_indexes[0]
    size = chunk.chunk_start_offset + 9 + 16
    if compression == 'gzip':
        data[size + 12:size + 16] = struct.pack('<I', 4)   # the next four bytes are taken for a name
        reason = 'damaged|unknown compression'
    else:
        data[size:size + 8] = struct.pack('<Q', 2 ** 50)
        reason = 'content is not the 1125899906842624 bytes announced'
    log.write_bytes(data)
    assert re.search(reason, refused(log))


@pytest.mark.parametrize('compression', ['lz4', 'zstd'])
@pytest.mark.parametrize('place', [0, 4, 5, 40])
def test_a_chunk_that_cannot_be_decompressed(tmp_path, compression, place):
    log = write_log(tmp_path / 'run.mcap', recorded(20), compression=compression)
    data = bytearray(log.read_bytes())
    with open(log, 'rb') as file:
        chunk = make_reader(file).get_summary().chunk_indexes[0]
    content = chunk.chunk_start_offset + 9 + 40 + len(compression)
    data[content + place] ^= 0xff
    log.write_bytes(data)
    assert 'damaged' in refused(log)


@settings(max_examples=150, deadline=2000)   # ms: no damage may make reading slow
@given(data=st.data())
def test_any_damage_is_read_or_refused(tmp_path_factory, small_log, data):
    damaged = drawn_damage(data.draw, small_log)
    path = tmp_path_factory.getbasetemp() / 'damaged.mcap'
    path.write_bytes(damaged)
    try:
        messages = list(read_log(path).messages)
    except LogError as error:
        assert str(path) in str(error)
    else:
        assert sum(len(message.data) for message in messages) <= 10 * len(small_log)


@pytest.fixture(scope='module', params=['none', 'lz4', 'zstd'])
def small_log(request, tmp_path_factory):
    """Return the bytes of a short log."""
    path = tmp_path_factory.mktemp('small') / 'run.mcap'
    return write_log(path, recorded(10), compression=request.param).read_bytes()


def run_python(code, *arguments, **options):
    """Start a Python process that imports what this one imports."""
    environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(entry for entry in sys.path if entry)}
    return subprocess.Popen([sys.executable, '-c', code, *map(str, arguments)], env=environment,
                            stdout=subprocess.PIPE, text=True, **options)


def test_kill_9_loses_nothing_that_was_flushed(tmp_path):
    # 200 small messages a second: without a flush in time nothing would be on the disk yet.
    process = run_python("""
import sys, time
from planar_chain_sim.recording.log_writer import BackgroundLogWriter, Channel
writer = BackgroundLogWriter(sys.argv[1], [Channel('/a', 'std_msgs/msg/String')], {'chain.yaml': b'name: x'},
                             {'planar_chain_sim': {'format': '1'}}, flush_period=0.2)
print('ready', flush=True)
for index in range(10 ** 6):
    now = time.time_ns()
    writer.write('/a', b'message', now, now, index)
    time.sleep(0.005)
""", tmp_path / 'run.mcap')
    with process:
        assert process.stdout.readline() == 'ready\n'
        flushed, deadline = set(), time.monotonic() + 300.0
        while len(flushed) < 4:   # none yet, then three flushes
            assert time.monotonic() < deadline, flushed
            time.sleep(0.02)
            flushed.add(len(list(read_log(tmp_path / 'run.mcap').messages)))
        process.send_signal(signal.SIGKILL)
    assert (tmp_path / 'run.mcap').stat().st_size < CHUNK_SIZE, 'no chunk was full'
    log = read_log(tmp_path / 'run.mcap')
    messages = list(log.messages)
    assert (log.complete, log.chain_text, log.settings) == (False, 'name: x', {'format': '1'})
    assert [message.sequence for message in messages] == list(range(len(messages))) and len(messages) >= max(flushed)


def test_full_disk(tmp_path):
    # A limit on the file size is the full disk of a user without root; Python ignores the signal that comes with it.
    process = run_python("""
import resource, sys, time
from planar_chain_sim.recording.log_writer import BackgroundLogWriter, Channel, LogError, LogWriter
resource.setrlimit(resource.RLIMIT_FSIZE, (300_000, 300_000))
arguments = [Channel('/a', 'std_msgs/msg/String')], {'chain.yaml': b'name: x'}, {'planar_chain_sim': {'format': '1'}}
try:
    with LogWriter(sys.argv[1], *arguments) as writer:
        for index in range(10_000):
            writer.write('/a', bytes(100), index, index, index)
except LogError as error:
    print(error)
writer = BackgroundLogWriter(sys.argv[2], *arguments, flush_period=0.02)
index = 0
while writer.error is None:
    writer.write('/a', bytes(100), index, index, index)
    index += 1
    while writer.backlog > 1000:
        time.sleep(0.001)
print(writer.error)
for _ in range(100_000):
    writer.write('/a', bytes(100), index, index, index)
print(writer.backlog)
writer.close()
print(writer.error)
try:
    LogWriter(sys.argv[3], arguments[0], {'chain.yaml': bytes(400_000)})
except LogError as error:
    print(error)
""", *(tmp_path / name for name in 'abc'), stderr=subprocess.PIPE)
    output, errors = process.communicate(timeout=600)
    assert (process.returncode, errors) == (0, '')
    sentences = [f"log '{tmp_path / name}': writing stopped, File too large" for name in 'abbc']
    assert output.splitlines() == sentences[:2] + ['0'] + sentences[2:]
    for name in 'ab':
        log = read_log(tmp_path / name)
        sequences = [message.sequence for message in log.messages]
        assert not log.complete and len(sequences) > 1000
        assert sequences == list(range(len(sequences)))
