"""Ctrl-C at a moment that suits: asked for between two steps, so that no step and no file is cut in two."""

import signal
import threading
from types import FrameType
from typing import Any

PATIENCE = 3  # presses after which Ctrl-C no longer waits for a step that does not end


class HeldInterrupt:
    """While it is entered, Ctrl-C is only remembered; the third press in a step that hangs raises as before.

    Compiled code turns KeyboardInterrupt into errors of its own, and one that comes while a log is finished would lose
    it. SIGTERM is taken as Ctrl-C where it is handled at all, as by the command line. Outside the main thread, and
    where Ctrl-C is ignored already, nothing changes.
    """

    def __init__(self) -> None:
        self.presses = 0
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "HeldInterrupt":
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                if callable(signal.getsignal(number)):
                    self._before[number] = signal.signal(number, self._press)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def check(self) -> None:
        """Raises KeyboardInterrupt if Ctrl-C came.

        Raises:
            KeyboardInterrupt: it came.
        """
        if self.presses:
            raise KeyboardInterrupt

    def _press(self, number: int, frame: FrameType | None) -> None:
        self.presses += 1
        if self.presses >= PATIENCE:
            self._before[number](number, frame)
