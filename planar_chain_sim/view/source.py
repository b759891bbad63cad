"""What a page can look at: a source has scenes, states, events and controls."""
from __future__ import annotations

from collections import deque
from threading import Thread
from time import monotonic
from typing import Any, Callable, Mapping, NamedTuple, Optional, Sequence

from .scene import frame, Scene, State
from ..errors import Mistake

SHORTEST = 0.008   # s between two frames
SHARE = 4          # a frame that took long to make is made again after so many times as long
KEPT = 2000   # events, for pages that open later
REPEATED = ('command', 'wrench')   # kinds that may come at every tick: of those in a row the last is kept


class Shown(NamedTuple):
    """The arms that are shown, as scenes and as the page gets them; `revision` grows when they change."""

    revision: int
    scenes: tuple[Scene, ...]
    described: list


class Drawn(NamedTuple):
    """A frame, which every page gets that asks for one before `until`, s of monotonic()."""

    shown: Shown
    frame: bytes
    until: float


class Source:
    """
    One thing to look at, for any number of pages.

    kind: 'chain', 'live' or 'log'. shown: its arms. status: what else the page shows. Both are replaced as a whole.
    Its methods are called in the thread of the server; a source may have a thread of its own that replaces what they
    read.
    """

    kind = ''

    def __init__(self) -> None:
        self.shown = Shown(0, (), [])
        self.status: Mapping[str, Any] = {}
        self.events = Kept()
        self.complaints = Kept()   # sentences: what could not be done
        self._drawn: Optional[Drawn] = None
        self._thread: Optional[Thread] = None
        self._stopping = False

    def start(self, failed: Callable[[BaseException], None]) -> None:
        """Begin; `failed` takes an error that ends the source."""
        def run() -> None:
            try:
                self._run()
            except BaseException as error:
                failed(error)
        self._thread = Thread(target=run, name=self.kind, daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End, after the pulls and efforts of all pages."""
        self._stopping = True
        if self._thread:
            self._thread.join()

    def _run(self) -> None:
        """Do what the source does in its own thread, until `_stopping`."""

    def states(self) -> Optional[Sequence[State]]:
        """Return the newest state of each arm; None if there is none yet."""
        return None

    def act(self, page: Any, action: Mapping[str, Any]) -> None:
        """Do what a page asks for; it returns at once. Mistake: it has no effect."""
        raise Mistake(f'{action["do"]!r} cannot be done here')

    async def answer(self, question: Mapping[str, Any]) -> Any:
        """Return bytes or JSON for a question of a page, of ANSWERED in the server; Mistake: there is no answer."""
        raise Mistake(f'{question["do"]!r} cannot be asked here')

    def leave(self, page: Any) -> None:
        """Let go of all that a page holds."""

    def show(self, scenes: Sequence[Scene]) -> None:
        """Show other arms from now on."""
        described = [scene.described() for scene in scenes]
        revision = self.shown.revision + (described != self.shown.described)
        self.shown = Shown(revision, tuple(scenes), described)

    async def frame(self, request: Mapping[str, Any]) -> Optional[bytes]:
        """Return the frame that a page asks for; None if there is nothing to be drawn. Mistake: a bad request."""
        begun, shown, drawn = monotonic(), self.shown, self._drawn
        if drawn is not None and drawn.shown is shown and begun < drawn.until:
            return drawn.frame
        states = self.states()
        if not states or [len(state.position) for state in states] != [
                scene.chain.joint_count for scene in shown.scenes]:
            return None
        made = frame(shown.revision, [scene.numbers(state) for scene, state in zip(shown.scenes, states)])
        now = monotonic()
        self._drawn = Drawn(shown, made, max(begun + SHORTEST, now + SHARE * (now - begun)))
        return made


class Kept:
    """The last KEPT things that were said, for readers that ask from time to time; any thread may use it."""

    def __init__(self) -> None:
        self.count = 0
        self._kept: deque = deque(maxlen=KEPT)   # (number, what)

    def say(self, what: Any) -> None:
        """Add something; of several events of a REPEATED kind in a row the last is kept."""
        last = self._kept[-1] if self._kept else None
        if last and isinstance(what, dict) and what['kind'] in REPEATED and last[1]['kind'] == what['kind']:
            self._kept.pop()
        self._kept.append((self.count, what))
        self.count += 1

    def since(self, count: int) -> list:
        """Return what was said from this number on, as far as it is kept."""
        return [what for number, what in list(self._kept) if number >= count]
