"""Artery's time and the drive's: Artery's begins with the warm-up, and its simulation knows no date."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone

from advpipe.pipeline.artery.records import Arrival, BusyRatio, NewStation, Transmission
from advpipe.pipeline.v2x.codec.timestamps import timestamp_its_ms

_EPOCH = datetime(1970, 1, 1, tzinfo=timezone.utc)
_ITS_EPOCH = datetime(2004, 1, 1, tzinfo=timezone.utc)

Timed = NewStation | Transmission | Arrival | BusyRatio


class DriveClock:
    """done_ns: the time of the drive up to which Artery has simulated; None before the drive."""

    def __init__(self) -> None:
        self.done_ns: int | None = None
        self._drive_ns: int | None = None
        self._offset_ns: int | None = None

    def begin(self, drive_ns: int) -> None:
        """The drive begins at this time, in nanoseconds since 1970, with SUMO's next step."""
        self._drive_ns = drive_ns

    def begin_step(self, artery_ns: int) -> bytes:
        """SUMO is at a time of Artery's: the date of Artery's time 0 if the drive has begun, else nothing."""
        if self._drive_ns is None:
            return b""
        if self._offset_ns is None:
            self._offset_ns = self._drive_ns - artery_ns
        return artery_date(self._drive_ns, self._offset_ns).encode()

    def finish_step(self, artery_ns: int) -> None:
        """Artery has simulated up to a time of its own."""
        if self._offset_ns is not None:
            self.done_ns = artery_ns + self._offset_ns

    def in_drive(self, record: Timed) -> Timed:
        """The record with the drive's time."""
        assert self._offset_ns is not None
        return record._replace(time_ns=record.time_ns + self._offset_ns)


def artery_date(drive_ns: int, zero_ns: int) -> str:
    """The UTC date, for Artery's parameter `datetime`, of its time 0, which is `zero_ns` since 1970.

    Artery counts no leap seconds, which TimestampIts does: its date is ahead by those since 2004.
    """
    its_epoch_ms = (_ITS_EPOCH - _EPOCH) // timedelta(milliseconds=1)
    leap_ms = timestamp_its_ms(drive_ns) - (drive_ns // 1_000_000 - its_epoch_ms)
    date = _EPOCH + timedelta(microseconds=zero_ns // 1000, milliseconds=leap_ms)
    return date.strftime("%Y-%m-%d %H:%M:%S.%f")
