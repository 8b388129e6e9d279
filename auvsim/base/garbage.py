"""Python's garbage collector, kept from looking through all that stands already while a loop runs."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = 20_000  # objects more than there were, from which on those of a loop are looked through


@contextmanager
def frozen_garbage() -> Iterator[None]:
    """Leaves what exists now out of collections until the end of the block; what comes to be in it is collected.

    Models, plans and modules are hundreds of thousands of objects that a run would have looked through again and
    again, and what a run adds are mostly rows of its log. Where something is frozen already, as in a block around this
    one, nothing changes.
    """
    if gc.get_freeze_count():
        yield
        return
    gc.freeze()
    thresholds = gc.get_threshold()
    if thresholds[0]:
        gc.set_threshold(max(thresholds[0], SELDOM), *thresholds[1:])
    try:
        yield
    finally:
        gc.set_threshold(*thresholds)
        gc.unfreeze()
