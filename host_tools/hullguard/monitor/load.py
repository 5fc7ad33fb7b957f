"""Bus load from the exact bits of every frame: mean, now, peak and 99th percentile of windows, in memory of a fixed size."""

from __future__ import annotations

import math

import numpy as np

PEAK_S, WINDOW_S = 0.1, 1.0
BINS = 1 << 14  # kept for the percentile: 27 minutes at 100 ms
_SLACK = 1e-3  # of a bin: time stamps carry microseconds, a sample may begin one before its bin


class BusLoad:
    """Bits in bins of at most 100 ms that divide a sample; a share of 1 is a full bus."""

    def __init__(self, sample_time_s: float, bitrate_bps: int) -> None:
        self._bin = sample_time_s / math.ceil(sample_time_s / PEAK_S - 1e-9)
        self._capacity = self._bin * bitrate_bps  # bits of a bin
        self._peak_bins, self._window_bins = max(1, round(PEAK_S / self._bin)), max(1, round(WINDOW_S / self._bin))
        self._start: float | None = None
        self.clear()

    def clear(self) -> None:
        """Begin again with the next frame."""
        self._ring = np.zeros(BINS)
        self._closed, self._open, self._total, self._peak, self._start = 0, 0.0, 0.0, 0.0, None

    def add(self, time_s: float, bits: float) -> None:
        """A frame, in bits of the nominal rate. Its place is the open bin, or a later one; time that steps back stays in the open bin."""
        self.move(time_s)
        self._open += bits

    def move(self, time_s: float) -> None:
        """Time goes on, with or without frames."""
        if self._start is None:
            self._start = time_s
        now = math.floor((time_s - self._start) / self._bin + _SLACK)
        if now - self._closed > BINS:  # silence longer than the ring: all of it is zero but what closes first
            self._close()
            self._ring[:] = 0
            self._closed = now
        while self._closed < now:
            self._close()

    def finish(self) -> None:
        """The end of a log: its last bin counts as a whole one."""
        if self._start is not None:
            self._close()

    def _close(self) -> None:
        self._ring[self._closed % BINS] = self._open
        self._closed, self._total, self._open = self._closed + 1, self._total + self._open, 0.0
        self._peak = max(self._peak, float(self._last(self._peak_bins).sum()))

    def _last(self, count: int) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        held = min(count, self._closed, BINS)
        return self._ring[np.arange(self._closed - held, self._closed) % BINS]

    @property
    def mean(self) -> float:
        """Since the start."""
        return self._total / (self._closed * self._capacity) if self._closed else 0.0

    @property
    def now(self) -> float:
        """Of the last second."""
        bins = self._last(self._window_bins)
        return float(bins.sum() / (len(bins) * self._capacity)) if len(bins) else 0.0

    @property
    def peak(self) -> float:
        """Largest of all windows of 100 ms."""
        return self._peak / (self._peak_bins * self._capacity)

    @property
    def p99(self) -> float:
        """99th percentile over the sliding windows of a second."""
        bins = self._last(BINS)
        width = min(self._window_bins, len(bins))
        if width == 0:
            return 0.0
        sums = np.cumsum(np.concatenate(([0], bins)))
        return float(np.percentile(sums[width:] - sums[:-width], 99) / (width * self._capacity))
