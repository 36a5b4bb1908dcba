"""How far a command is: its work has phases, these have phases of their own, and one of each is going on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping

UNPLANNED = 0.05
"""What a phase that nobody planned takes, as a share of all that is still to come."""

SLOW_S = 3.0
"""A phase that has done no item shows its seconds when it has taken this long."""


class Phase:
    """A part of a command's work, from `begin` to `end` of the whole, which goes from 0 to 1.

    done: how far the command is; it never falls, and it reaches `end` only with the phase. total: number of
    the items that the phase goes through, None if it has none or they are not counted. status: returns a text
    to show beside them. moved_s: when `done` rose for the last time, by the monotonic clock.
    """

    def __init__(
        self,
        name: str,
        begin: float = 0.0,
        end: float = 1.0,
        *,
        total: int | None = None,
        status: Callable[[], str] | None = None,
    ) -> None:
        self.name, self.begin, self.end, self.done = name, begin, end, begin
        self.total, self.status, self.count = total, status, 0
        self.begin_s = self.moved_s = time.monotonic()
        self._shares: dict[str, float] = {}

    def plan(self, shares: Mapping[str, float]) -> None:
        """Expect these phases, in this order; shares: of the time, in any unit."""
        self._shares = dict(shares)

    def part(self, name: str, total: int | None = None, status: Callable[[], str] | None = None) -> Phase:
        """The phase within this one that begins now.

        A phase of the plan takes its share of the rest; those before it were left out, and the rest shares
        their time. A phase that is not in the plan takes a small share; where there is no plan at all, one
        with items takes half.
        """
        if name in self._shares:
            names = list(self._shares)
            for skipped in names[: names.index(name)]:
                del self._shares[skipped]
            share = self._shares.pop(name)
            rest = sum(self._shares.values())
        else:
            rest = sum(self._shares.values()) or 1.0
            share = rest if total is not None and not self._shares else UNPLANNED * rest
        room = self._room_end() - self.done
        part = Phase(name, self.done, self.done + room * share / (share + rest), total=total, status=status)
        part.moved_s = self.moved_s
        return part

    def leave(self, part: Phase) -> None:
        """Go on after a part that is done."""
        self._rise(part.end)

    def advance(self) -> None:
        """Count one more item as done."""
        self.count += 1
        if self.total:
            self._rise(self._place(self.count))

    def reach(self, share: float) -> None:
        """Say how much of a phase without items is done, from 0 to 1."""
        self._rise(self.begin + (self.end - self.begin) * min(share, 1.0))

    def text(self, is_last: bool) -> str:
        """Such as `detecting: 12 of 40`; while the last phase has not done an item, its seconds once they
        are many."""
        text = self.name
        if self.total:
            text += f": {min(self.count, self.total):,} of {self.total:,}"
        elif self.count:
            text += f": {self.count:,}"
        spent_s = time.monotonic() - self.begin_s
        return f"{text}, {spent_s:.0f} s" if is_last and not self.count and spent_s >= SLOW_S else text

    def _rise(self, done: float) -> None:
        if done > self.done:
            self.done, self.moved_s = done, time.monotonic()

    def _room_end(self) -> float:
        """Where a part may end: with the item that is going on, where there are items."""
        return self._place(self.count + 1) if self.total else self.end

    def _place(self, count: int) -> float:
        assert self.total
        return self.begin + (self.end - self.begin) * min(count / self.total, 1.0)
