"""
LogWriter and BackgroundLogWriter: the MCAP log, in the profile in which rosbag2 of ROS 2 Jazzy writes its own files.

In the file: header, attachments, metadata, the bag information of an empty bag, then chunks of messages with their
indexes, and at close the bag information again and the summary. So everything needed to read the rest comes first, and
a process that is killed loses only the messages after the last flush.
"""
from __future__ import annotations

from io import BufferedWriter, FileIO
import os
from pathlib import Path
from threading import Event, Thread
from time import monotonic
from typing import Mapping, Optional, Sequence
from warnings import warn

from .mcap_library import require_mcap
from .message_types import MESSAGE_TYPES
from .rosbag2_profile import bag_information, Channel, channel_metadata, NO_TIME
from ..errors import LogError

try:
    from .mcap_file import CHUNK_SIZE, McapFile
except ImportError:
    pass   # LogWriter says so in words

COMPRESSIONS = {'none': '', 'lz4': 'lz4', 'zstd': 'zstd'}
LOOK_PERIOD = 0.05          # s between two looks of a BackgroundLogWriter's thread at its chunk
WATCH_PERIOD = 0.5          # s between two looks at whether the file is still where it was
BACKLOG_LIMIT = 10 ** 8     # bytes; a disk this far behind will not catch up


class _NewFile(FileIO):
    """A file that is only appended to; if another process cuts it short, its size stays below the bytes written."""

    def __init__(self, path):
        super().__init__(path, 'x', opener=lambda name, flags: os.open(name, flags | os.O_APPEND, 0o666))
        self.given = 0

    def write(self, data) -> int:
        taken = super().write(data)
        self.given += taken or 0
        return taken

    def tell(self) -> int:
        return self.given


class LogWriter:
    """
    Writes one MCAP log, in the calling thread.

    path: of the new file; channels: every topic that will be written; attachments: name -> bytes; metadata: name ->
    {str: str}; flush_period: s, after which a write closes the chunk and hands it to the system; compression: of
    chunks, a key of COMPRESSIONS. LogError if the file is there already, cannot be made or an argument is wrong.
    chunk: LogChunk in the making; channel_ids: topic -> its number there. For who appends too often for append().
    """

    def __init__(self, path, channels: Sequence[Channel], attachments: Optional[Mapping[str, bytes]] = None,
                 metadata: Optional[Mapping[str, Mapping[str, str]]] = None, flush_period: float = 0.5,
                 compression: str = 'none'):
        require_mcap(path)
        self.path = Path(path)
        self._channels = tuple(channels)
        self._check(flush_period, compression)
        self.flush_period = flush_period
        self._file = self._create()
        self._failure: Optional[str] = None   # why writing ended
        try:
            self._mcap = McapFile(self._file, 'ros2', 'planar_chain_sim', COMPRESSIONS[compression])
            self.chunk = self._mcap.chunk
            self._begin(attachments or {}, metadata or {})
        except OSError as error:
            failure = self._fail(error.strerror or str(error))
            self.path.unlink(missing_ok=True)   # there is nothing in it
            raise failure from None
        self.flush_due = monotonic() + flush_period

    def __enter__(self) -> 'LogWriter':
        return self

    def __exit__(self, *exception) -> None:
        self.close()

    def write(self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0) -> None:
        """
        Append one message, as append() does; hand what is long or old enough to the system, LogError where that fails.

        After a failed write the file is closed.
        """
        self.append(topic, data, log_time_ns, publish_time_ns, sequence)
        self.flush_when_due()

    def append(self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0) -> int:
        """
        Append one message (CDR with encapsulation) to the chunk in the making, from any thread; return its size, bytes.

        Times in ns since the epoch or the start; sequence is taken mod 2**32. Messages of several sources may come
        slightly out of order: one that is older than its predecessor gets the predecessor's log time, so that the
        file's log time never goes back; its publish time stays as it is. LogError on a topic with no channel and on a
        message that cannot be stored, which harms nothing, and after a failure.
        """
        if self._failure:
            raise LogError(self._failure)
        channel_id = self.channel_ids.get(topic)
        if channel_id is None:
            raise LogError(f'log {str(self.path)!r}: topic {topic!r} has no channel, must be one of '
                           f'{", ".join(self.channel_ids)}')
        try:
            return self.chunk.add_message(channel_id, log_time_ns, data, publish_time_ns, sequence & 0xFFFFFFFF)
        except TypeError:
            raise LogError(f'log {str(self.path)!r}: {topic} got a message that cannot be stored, '
                           f'{type(data).__name__} at {log_time_ns!r} and {publish_time_ns!r} ns, must be bytes and '
                           'whole times below 2**64') from None

    @property
    def backlog(self) -> int:
        """Number of messages not yet flushed; 0 after a failure."""
        return 0 if self._failure else self.chunk.messages

    def flush_when_due(self, ahead: float = 0.0) -> None:
        """Flush if the chunk is long enough, or would be too old in `ahead` s; LogError."""
        if self.chunk.size > CHUNK_SIZE or monotonic() + ahead >= self.flush_due:
            self.flush()

    def flush(self) -> None:
        """Close the chunk in the making and hand all to the system, where a killed process cannot lose it; LogError."""
        if self._failure:
            raise LogError(self._failure)
        try:
            self._mcap.flush()
        except OSError as error:
            raise self._fail(error.strerror or str(error)) from None
        self.flush_due = monotonic() + self.flush_period

    def whereabouts(self) -> tuple[str, bool]:
        """Return a sentence on what others have done to the open file, '' for nothing; and whether the log is lost."""
        try:
            given = self._file.raw.given   # before the size: the file grows
            mine = os.fstat(self._file.fileno())
            try:
                there = os.stat(self.path)
            except (FileNotFoundError, NotADirectoryError):
                there = None
        except (OSError, ValueError):   # ValueError: closed meanwhile
            return '', False
        name = f'log {str(self.path)!r}'
        if not mine.st_nlink:
            return f'{name}: the file has been deleted, what is recorded will be lost', True
        if there is None:
            return f'{name}: the file has been moved, recording continues in it at its new place', False
        if not os.path.samestat(mine, there):
            return f'{name}: another file has this name now, recording continues in the first one', False
        if mine.st_size < given:
            return f'{name}: the file has been cut short, the log is damaged', True
        return '', False

    def close(self) -> None:
        """
        Finish the file with its summary; nothing is done a second time or after a failure.

        LogError where that fails or the file has been deleted; a file that was moved is warned of.
        """
        if self._file.closed:
            return
        self.flush()
        where, _ = self.whereabouts()
        if where and not os.fstat(self._file.fileno()).st_nlink:
            raise self._fail('the file has been deleted')
        if where:
            warn(where, RuntimeWarning, stacklevel=2)
        try:
            self._mcap.add_metadata('rosbag2', self._bag_information())
            self._mcap.finish()
            self._file.close()
        except OSError as error:
            raise self._fail(error.strerror or str(error)) from None
        self._failure = f'log {str(self.path)!r}: it is closed'

    def _check(self, flush_period: float, compression: str) -> None:
        if not 0.0 < flush_period < float('inf'):
            raise LogError(f'log {str(self.path)!r}: flush_period is {flush_period}, must be positive seconds')
        if compression not in COMPRESSIONS:
            raise LogError(f'log {str(self.path)!r}: compression is {compression!r}, must be one of '
                           f'{", ".join(COMPRESSIONS)}')
        topics = [channel.topic for channel in self._channels]
        if len(set(topics)) < len(topics):
            raise LogError(f'log {str(self.path)!r}: two channels have the same topic, topics are {", ".join(topics)}')
        for channel in self._channels:
            if channel.type_name not in MESSAGE_TYPES:
                raise LogError(f'log {str(self.path)!r}: type {channel.type_name!r} of {channel.topic} has no '
                               f'definition here, must be one of {", ".join(MESSAGE_TYPES)}')

    def _create(self):
        try:
            if self.path.is_dir():
                raise LogError(f'log {str(self.path)!r}: it is a directory, must be the name of a new file')
            if not self.path.parent.is_dir():
                raise LogError(f'log {str(self.path)!r}: its folder {str(self.path.parent)!r} does not exist')
            return BufferedWriter(_NewFile(self.path))
        except FileExistsError:
            raise LogError(f'log {str(self.path)!r}: the file exists and is not overwritten, give a new name') from None
        except (OSError, ValueError) as error:
            reason = getattr(error, 'strerror', None) or error
            raise LogError(f'log {str(self.path)!r}: the file cannot be made ({reason})') from None

    def _begin(self, attachments: Mapping[str, bytes], metadata: Mapping[str, Mapping[str, str]]) -> None:
        mcap = self._mcap
        for name, data in attachments.items():
            media_type = 'application/yaml' if name.endswith('.yaml') else 'application/octet-stream'
            mcap.add_attachment(name, media_type, data)
        for name, entries in metadata.items():
            mcap.add_metadata(name, entries)
        mcap.add_metadata('rosbag2', self._bag_information())
        self._file.flush()

        schemas, self.channel_ids = {}, {}
        for channel in self._channels:
            name = channel.type_name
            if name not in schemas:
                schemas[name] = mcap.add_schema(name, 'ros2msg', MESSAGE_TYPES[name].definition.encode())
            self.channel_ids[channel.topic] = mcap.add_channel(channel.topic, 'cdr', schemas[name],
                                                               channel_metadata(channel))

    def _bag_information(self) -> dict:
        mcap, channels = self._mcap, self._channels
        counts = {channel.topic: mcap.counts.get(number, 0) for number, channel in enumerate(channels, 1)}
        first, last = (mcap.first_time, mcap.last_time) if mcap.counts else (NO_TIME, NO_TIME)
        return {'serialized_metadata': bag_information(self.path.name, channels, counts, first, last)}

    def _fail(self, reason: str) -> LogError:
        """Stop writing; the file on the disk is readable up to its last whole chunk."""
        self._failure = f'log {str(self.path)!r}: writing stopped, {reason}'
        self._file.raw.close()   # the raw file: what is still buffered could not be written either
        return LogError(self._failure)


class BackgroundLogWriter:
    """
    The same log, written by a thread of its own, so that the thread which steps the chain never waits for a disk.

    Takes LogWriter's arguments and raises its LogError when the file cannot be made. error: None, or the LogError that
    ended the writing (disk full, disk too slow, a message that no log takes); messages are then dropped.
    """

    def __init__(self, *arguments, **options):
        self._writer = LogWriter(*arguments, **options)
        self._add, self._channel_ids = self._writer.chunk.add_message, self._writer.channel_ids
        self.error: Optional[LogError] = None
        self._accepting, self._whereabouts, self._watch_due = True, ('', False), monotonic() + WATCH_PERIOD
        self._closing = Event()
        self._thread = Thread(target=self._run, name='log writer', daemon=True)
        self._thread.start()

    def __enter__(self) -> 'BackgroundLogWriter':
        return self

    def __exit__(self, *exception) -> None:
        self.close()

    @property
    def backlog(self) -> int:
        """Number of messages not yet flushed; a run faster than real time should wait when it is large."""
        return self._writer.backlog

    @property
    def trouble(self) -> str:
        """Return the error, or a sentence on what other processes have done to the file up to 0.5 s ago, or ''."""
        return str(self.error) if self.error else self._whereabouts[0]

    @property
    def lost(self) -> bool:
        """Whether the log ends here: writing has failed, or others have deleted the file or cut it short."""
        return self.error is not None or self._whereabouts[1]

    def write(self, topic: str, data: bytes, log_time_ns: int, publish_time_ns: int, sequence: int = 0) -> None:
        """Append one message as LogWriter.append does, from any thread; never blocks and never raises."""
        if not self._accepting:
            return
        try:   # what append() does, in less time as several messages come at every tick; it says what is wrong with one
            size = self._add(self._channel_ids[topic], log_time_ns, data, publish_time_ns, sequence)
            if size > BACKLOG_LIMIT:
                self._stop(LogError(f'log {str(self._writer.path)!r}: writing stopped, the disk is '
                                    f'{BACKLOG_LIMIT * 1e-6:g} MB behind'))
        except (KeyError, TypeError):
            try:
                self._writer.append(topic, data, log_time_ns, publish_time_ns, sequence)
            except LogError as error:
                self._stop(error)

    def close(self) -> None:
        """Write all messages, finish the file and end the thread; a failure is left in `error`."""
        self._accepting = False
        self._closing.set()
        self._thread.join()

    def _stop(self, error: LogError) -> None:
        self._accepting = False
        self.error = self.error or error

    def _run(self) -> None:
        for work in (self._write_until_closed, self._writer.close):
            try:
                work()
            except LogError as error:
                self._stop(error)
            except BaseException:   # a mistake of ours: Python shows its traceback, and nobody waits for this thread
                self._stop(LogError(f'log {str(self._writer.path)!r}: writing stopped by a bug, traceback above'))
                raise

    def _write_until_closed(self) -> None:
        period = min(LOOK_PERIOD, self._writer.flush_period / 4)
        while not self._closing.wait(period):
            self._writer.flush_when_due(period)   # the next look would be too late
            if monotonic() >= self._watch_due:
                self._watch_due = monotonic() + WATCH_PERIOD
                self._whereabouts = self._writer.whereabouts()
