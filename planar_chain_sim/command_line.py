"""What all command lines share: help with an example, one sentence on stderr and exit code 2 for a mistake."""
from __future__ import annotations

from argparse import ArgumentParser, HelpFormatter
from contextlib import suppress
import errno
import os
import re
import signal
import sys
import textwrap
from typing import Callable, NoReturn, Optional, Sequence
import warnings

from .errors import Mistake, RobotFileNote

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
ENDED_BY = 128   # and the signal's number: the shell's code for a command that a signal ended
NUMBERS = re.compile(r'-(?:[\d.]|inf|nan|pi)')   # the beginning of a value that is not an option
LONGEST = 4000      # characters of a sentence
PICTURES_NEED = 'pictures need `pip install matplotlib pillow imageio-ffmpeg`'
NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EBADF)


class Paragraphs(HelpFormatter):
    """Help as wide as the terminal: paragraphs are filled, lines that begin with blanks are wrapped each by itself."""

    def _fill_text(self, text, width, indent):
        blocks = []
        for line in text.splitlines():
            if line[:1].isspace() or not line or not blocks or not blocks[-1] or blocks[-1][:1].isspace():
                blocks.append(line)
            else:
                blocks[-1] += f' {line}'
        broken = ' \\\n' if text.startswith('example:') else '\n'   # so that a shell takes it
        return '\n'.join(broken.join(self._wrapped(line, max(width - 2, 20))) for line in blocks) + '\n'

    @staticmethod
    def _wrapped(line: str, width: int) -> list:
        begin = line[:len(line) - len(line.lstrip())]
        return textwrap.wrap(line.strip(), width, initial_indent=begin, subsequent_indent=begin and f'{begin}    ',
                             break_long_words=False, break_on_hyphens=False)


class Parser(ArgumentParser):
    """An argument parser that refuses with one sentence and takes negative numbers as values."""

    def __init__(self, program: str, description: str, example: str):
        super().__init__(program, description=description, epilog=f'example:\n  {example}', allow_abbrev=False,
                         formatter_class=Paragraphs)

    def parse_known_args(self, args=None, namespace=None):
        """Join `--option -1,2` to `--option=-1,2` first."""
        arguments = list(sys.argv[1:] if args is None else args)
        takes_value = {flag for action in self._actions if action.nargs is None for flag in action.option_strings
                       if flag.startswith('--')}
        for k in reversed(range(len(arguments) - 1)):
            if arguments[k] in takes_value and NUMBERS.match(arguments[k + 1]):
                arguments[k:k + 2] = [f'{arguments[k]}={arguments[k + 1]}']
        return super().parse_known_args(arguments, namespace)

    def print_help(self, file=None) -> None:
        """Print the help; OSError where it cannot be written, which argparse would not say."""
        (file or sys.stdout).write(self.format_help())

    def error(self, message: str) -> NoReturn:
        """Raise the refusal."""
        raise Mistake(f'{message} (see {self.prog} --help)')


def add_hold(parser: Parser) -> None:
    """Add `--hold`, for load_chain(..., hold=...)."""
    parser.add_argument('--hold', action='append', metavar='JOINT[=VALUE]', help='weld a joint at this '
                        'value, rad or m (an angle also as 90deg), or at its initial position; can be given several '
                        'times')


def refuse_hold(options) -> None:
    """Raise Mistake for `--hold` with a log, whose joints are fixed."""
    if options.hold:
        raise Mistake('--hold is for chain files, but the file given is a log')


def refuse_existing(path: str) -> None:
    """Raise Mistake if the output exists already."""
    if os.path.isfile(path):
        raise Mistake(f'{path!r}: the file exists and is not overwritten, give a new name')


def run_command(program: str, body: Callable[[Optional[Sequence[str]]], int],
                arguments: Optional[Sequence[str]]) -> int:
    """
    Run `body(arguments)` and return its exit code; 2 and one sentence on stderr for a user's mistake; 130 after Ctrl-C.

    SIGTERM and SIGHUP act like Ctrl-C, so that files are closed properly, with exit codes 143 and 129. Other errors
    show their traceback, also with exit code 2.
    """
    catch_stop_signals(_interrupt)
    warnings.showwarning = lambda message, category, *_: report(
        program, f'{"note" if issubclass(category, RobotFileNote) else "warning"}: {message}')
    try:
        return exit_code(program, lambda: body(arguments))
    except KeyboardInterrupt as stop:
        report(program, 'interrupted')
        return ENDED_BY + (stop.args[0] if stop.args else signal.SIGINT)


def catch_stop_signals(handler: Callable) -> None:
    """
    Set `handler(number, frame)` for every stop signal; a SIGHUP that is ignored, as under nohup, stays ignored.

    SIGINT is caught even if it is ignored, as in a background job of a shell.
    """
    for number in STOP_SIGNALS:
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def _interrupt(number, frame) -> NoReturn:
    raise KeyboardInterrupt(int(number))


def exit_code(program: str, work: Callable[[], int]) -> int:
    """Return the exit code of `work()`: 2 after a sentence or a traceback on stderr, 0 if stdout has no reader now."""
    open_streams()
    if hasattr(sys.stdout, 'reconfigure'):
        sys.stdout.reconfigure(errors='backslashreplace')   # a name may have letters that the locale has not
    code = 0
    try:
        try:
            code = work()
        finally:   # SystemExit too, after --help
            sys.stdout.flush()
        return code
    except BrokenPipeError:   # the reader of our output has gone, as in `... | head`
        leave_output()
        return code
    except Exception as error:
        sentence = sentence_of(error)
        if sentence is None:
            raise_to_user(error)
        else:
            report(program, sentence)
        return 2


def open_streams() -> None:
    """Open the null device for standard streams that were closed at the start, so that no file gets their number."""
    missing = [name for name in ('stdin', 'stdout', 'stderr') if getattr(sys, name) is None]
    if missing:
        while (number := os.open(os.devnull, os.O_RDWR)) <= 2:
            pass
        os.close(number)
    for name in missing:
        setattr(sys, name, open(os.devnull, 'r' if name == 'stdin' else 'w'))


def sentence_of(error: Exception) -> Optional[str]:
    """Return the sentence for a user's mistake, None for a bug."""
    if isinstance(error, OSError) and error.filename is None and error.errno in NOT_WRITTEN:
        leave_output()
        return f'its output cannot be written ({error.strerror})'
    if isinstance(error, MemoryError):
        return f'there is not enough memory{f" ({error})" if str(error) else ""}, try a smaller task'
    return str(error) if isinstance(error, Mistake) else None


def raise_to_user(error: Exception) -> None:
    """Show the traceback of a bug."""
    import traceback
    with suppress(OSError, ValueError):
        traceback.print_exception(type(error), error, error.__traceback__)


def report(program: str, sentence: str) -> None:
    """Write one sentence on stderr, if that is open; line ends from arguments are escaped."""
    sentence = ''.join(each if each.isprintable() else repr(each)[1:-1] for each in sentence[:LONGEST])
    with suppress(OSError, ValueError, AttributeError):
        print(f'{program}: {sentence}', file=sys.stderr, flush=True)


def print_line(text: str) -> None:
    """Print a line at once; if its reader has gone, the work goes on without it."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        leave_output()


def write_document(text: str) -> None:
    """Write UTF-8, whatever the locale: a file or a pipe gets the same bytes as a terminal."""
    if hasattr(sys.stdout, 'reconfigure'):
        sys.stdout.reconfigure(encoding='utf-8')
    print(text, end='', flush=True)


def leave_output() -> None:
    """Discard what is still to be written: nobody reads it, or the disk is full."""
    with suppress(OSError, ValueError, AttributeError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
