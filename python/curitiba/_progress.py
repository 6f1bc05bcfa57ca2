"""The line that says how far long work is."""

import sys
from typing import Optional

_CELLS = 30
_shown: Optional[bool] = None
_width = 0


def set_progress(shown: Optional[bool] = None) -> None:
    """Sets when work that takes longer than a second shows its progress, in a line on `sys.stderr`.

    `shown`: True for always, False for never, None for terminals and notebooks only.
    """
    global _shown
    _shown = shown


def _wanted() -> bool:
    if _shown is not None:
        return _shown
    return sys.stderr is not None and (sys.stderr.isatty() or "ipykernel" in sys.modules)


def show(step: str, done: int, total: int, seconds: float) -> None:
    """Draws the line over the one before. `total` is 0 where it is not known."""
    global _width
    if not _wanted():
        return
    elapsed = f"{int(seconds) // 60}:{int(seconds) % 60:02}"
    line = f"{step} {elapsed}"
    if total > 0:
        share = min(done / total, 1.0)
        full = int(share * _CELLS)
        line = f"{step} [{'#' * full}{'-' * (_CELLS - full)}] {int(share * 100)}% {elapsed}"
    sys.stderr.write("\r" + line.ljust(_width))
    sys.stderr.flush()
    _width = len(line)


def clear() -> None:
    """Takes the line away."""
    global _width
    if _width and sys.stderr is not None:
        sys.stderr.write("\r" + " " * _width + "\r")
        sys.stderr.flush()
    _width = 0
