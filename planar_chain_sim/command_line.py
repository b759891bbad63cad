"""What every command line here keeps to: help with an example, one sentence on stderr and exit code 2 for a mistake."""
from __future__ import annotations

from argparse import ArgumentParser, RawDescriptionHelpFormatter
import signal
import sys
from typing import Callable, NoReturn, Optional, Sequence
import warnings

INTERRUPTED = 130   # the shell's code for a command that Ctrl-C ended


class Mistake(Exception):
    """Something the user can mend: one sentence."""


class Parser(ArgumentParser):
    """An argument parser whose refusal is one sentence."""

    def __init__(self, program: str, description: str, example: str):
        super().__init__(program, description=description, epilog=f'example:\n  {example}', allow_abbrev=False,
                         formatter_class=RawDescriptionHelpFormatter)

    def error(self, message: str) -> NoReturn:
        """Raise the refusal."""
        raise Mistake(f'{message} (see {self.prog} --help)')


def run_command(program: str, body: Callable[[Optional[Sequence[str]]], int],
                arguments: Optional[Sequence[str]]) -> int:
    """
    Run `body(arguments)` and return its exit code; 2 and one sentence on stderr for a user's mistake; 130 after Ctrl-C.

    SIGTERM is taken for Ctrl-C, so that files are closed as they should be.
    """
    from .chain import ChainError
    from .dynamics import SimulationError
    from .recording.log_writer import LogError

    for number in (signal.SIGINT, signal.SIGTERM):   # SIGINT too: a shell's background job is born deaf to it
        signal.signal(number, signal.default_int_handler)
    warnings.showwarning = lambda message, *_: print(f'{program}: warning: {message}', file=sys.stderr)
    try:
        return body(arguments)
    except (Mistake, ChainError, LogError, SimulationError, ValueError) as error:
        print(f'{program}: {error}', file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print(f'{program}: interrupted', file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:    # the reader of our output has gone, as in `... | head`
        sys.stderr.close()
        return 0
