"""Ctrl-C and SIGTERM in whatever code: remembered, since compiled code turns KeyboardInterrupt into other errors."""

import signal
from types import FrameType, TracebackType
from typing import Any

UNTOUCHED = {signal.SIGINT: signal.default_int_handler, signal.SIGTERM: signal.SIG_DFL}


class Interruption:
    """While it is entered, remembers whether Ctrl-C or SIGTERM came, which both raise KeyboardInterrupt.

    What somebody else takes care of, or what is to be ignored, stays as it is.
    """

    def __init__(self) -> None:
        self.came = False
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "Interruption":
        for number, handler in UNTOUCHED.items():
            if signal.getsignal(number) is handler:
                try:
                    self._before[number] = signal.signal(number, self._interrupt)
                except ValueError:  # only the main thread may
                    break
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt
