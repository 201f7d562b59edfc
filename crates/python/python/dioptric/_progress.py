"""Progress on a terminal or in a notebook: tqdm's bar where that is installed, else a line."""

from __future__ import annotations

import importlib
import sys
from typing import Any


class Bar:
    """A bar that shows the stage and the part of it that is done."""

    def __init__(self) -> None:
        self._stage = ""
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
        elif stage != self._stage:
            print(stage, file=sys.stderr)
        self._stage = stage

    def close(self) -> None:
        """Takes the bar away."""
        if self._bar is not None:
            self._bar.close()
