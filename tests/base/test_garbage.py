"""Collections leave out what was there before, and find what a loop leaves behind."""

import gc
import weakref

import pytest

from auvsim.base.garbage import frozen_garbage


class Ring:
    """An object that refers to itself."""

    def __init__(self) -> None:
        self.itself = self


def lost() -> weakref.ref:
    return weakref.ref(Ring())


def test_only_what_comes_to_be_in_the_block_is_collected():
    gc.collect()
    before = lost()
    with frozen_garbage():
        within = lost()
        gc.collect()
        assert before() is not None
        assert within() is None
    gc.collect()
    assert before() is None


def test_blocks_in_a_block_and_what_a_user_froze_stay_as_they_are():
    with frozen_garbage():
        count = gc.get_freeze_count()
        assert count > 0
        with frozen_garbage():
            pass
        assert gc.get_freeze_count() == count
    assert gc.get_freeze_count() == 0


def test_an_error_ends_it():
    with pytest.raises(KeyError), frozen_garbage():
        raise KeyError
    assert gc.get_freeze_count() == 0


@pytest.mark.parametrize("thresholds", [(700, 10, 10), (50_000, 5, 5), (0, 10, 10)])
def test_a_loop_is_looked_through_seldom_and_never_oftener_than_the_user_wants(thresholds):
    before = gc.get_threshold()
    gc.set_threshold(*thresholds)
    try:
        with frozen_garbage():
            within = gc.get_threshold()
        assert gc.get_threshold() == thresholds
    finally:
        gc.set_threshold(*before)
    assert within == ((max(thresholds[0], 20_000), *thresholds[1:]) if thresholds[0] else thresholds)
