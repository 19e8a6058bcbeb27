"""The command line: `deepfusion …` and `python -m deepfusion …`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

from . import _native


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the command line with these arguments, or the process's own, and returns its exit code. For a process that does
    nothing else: from then on, the command handles Ctrl-C."""
    # Otherwise Python would defer Ctrl-C until the command has ended.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return _native.command(list(sys.argv[1:] if arguments is None else arguments))


if __name__ == "__main__":
    sys.exit(main())
