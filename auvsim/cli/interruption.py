"""Ctrl-C in whatever code: remembered, since compiled code turns KeyboardInterrupt into errors of its own."""

import signal
from types import FrameType, TracebackType
from typing import Any


class Interruption:
    """While it is entered, remembers whether Ctrl-C came, which raises KeyboardInterrupt as ever."""

    def __init__(self) -> None:
        self.came = False
        self._before: Any = None

    def __enter__(self) -> "Interruption":
        try:
            self._before = signal.getsignal(signal.SIGINT)
            if self._before is signal.default_int_handler:  # else somebody else takes care, or it is to be ignored
                signal.signal(signal.SIGINT, self._interrupt)
        except ValueError:  # only the main thread may
            self._before = None
        return self

    def __exit__(self, *_: type[BaseException] | BaseException | TracebackType | None) -> None:
        if self._before is signal.default_int_handler:
            signal.signal(signal.SIGINT, self._before)

    def _interrupt(self, number: int, frame: FrameType | None) -> None:
        self.came = True
        raise KeyboardInterrupt
