"""Progress on a terminal or in a notebook: tqdm's bar where that is installed, else a line now and then."""

from __future__ import annotations

import importlib
import sys
import time
from typing import Any

# A line is printed when the last one is so old, s.
_PAUSE_S = 1.0


class Bar:
    """A bar that shows the stage and the part of it that is done."""

    def __init__(self) -> None:
        self._next_s = 0.0
        self._bar: Any = None
        try:
            tqdm = importlib.import_module("tqdm.auto")
        except ImportError:
            return
        self._bar = tqdm.tqdm(total=100, unit="%", bar_format="{desc}: {percentage:3.0f}%|{bar}| {elapsed}")

    def __call__(self, stage: str, fraction: float) -> None:
        """Shows a stage that is done to this part, 0-1."""
        if self._bar is not None:
            self._bar.set_description_str(stage, refresh=False)
            self._bar.n = round(100 * fraction)
            self._bar.refresh()
        elif time.monotonic() >= self._next_s:
            print(f"{stage}: {100 * fraction:.0f}%", file=sys.stderr)
            self._next_s = time.monotonic() + _PAUSE_S

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
