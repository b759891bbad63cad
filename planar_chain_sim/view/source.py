"""What a page can look at: a source has scenes, states, events and controls."""
from __future__ import annotations

from collections import deque
from typing import Any, Mapping, Optional, Sequence

from .scene import frame, Scene, State
from ..errors import Mistake

KEPT = 2000   # events for pages that come or look later


class Source:
    """
    One thing to look at, for any number of pages.

    kind: 'chain', 'live' or 'log'. scenes: an arm each; replaced as a whole, with `revision`, when something about them
    changes. status: what the page shows beside, JSON; replaced as a whole when it changes. Its methods are called in
    the thread of the server, its own thread may replace what they read.
    """

    kind = ''

    def __init__(self) -> None:
        self.scenes: tuple[Scene, ...] = ()
        self.revision = 0
        self.status: Mapping[str, Any] = {}
        self.event_count = 0                       # since the start
        self._events: deque = deque(maxlen=KEPT)   # (number, event)
        self._drawn: Optional[tuple] = None

    def start(self) -> None:
        """Begin."""

    def close(self) -> None:
        """End; what pages hold is let go before."""

    def states(self) -> Optional[Sequence[State]]:
        """Return the newest state of each scene; None if there is none yet."""
        return None

    def act(self, page: Any, action: Mapping[str, Any]) -> None:
        """Do what a page asks for; it returns at once. Mistake: it has no effect."""
        raise Mistake(f'{action["do"]!r} cannot be done here')

    def leave(self, page: Any) -> None:
        """Let go of all that a page holds."""

    def announce(self, scenes: Sequence[Scene]) -> None:
        """Show other arms from now on."""
        self.scenes, self.revision = tuple(scenes), self.revision + 1

    def tell(self, event: Mapping[str, Any]) -> None:
        """Show an event."""
        self._events.append((self.event_count, event))
        self.event_count += 1

    def events_since(self, count: int) -> list:
        """Return the events from this number on, as far as they are kept."""
        return [event for number, event in list(self._events) if number >= count]

    async def frame(self, request: Mapping[str, Any]) -> Optional[bytes]:
        """Return the frame that a page asks for; None if there is nothing to be drawn. Mistake: a bad request."""
        revision, scenes, states = self.revision, self.scenes, self.states()
        if states is None or len(states) != len(scenes):
            return None
        drawn = self._drawn
        if drawn is None or drawn[0] != revision or any(old is not new for old, new in zip(drawn[1], states)):
            drawn = revision, states, frame(revision, [scene.numbers(state) for scene, state in zip(scenes, states)])
            self._drawn = drawn   # for other pages
        return drawn[2]
