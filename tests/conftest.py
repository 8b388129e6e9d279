"""Tests draw as the command does: `auvsim` chooses the renderer before any of them imports MuJoCo."""

import os

if "PYTEST_XDIST_WORKER" in os.environ:  # processes that share the cores: threads inside each would take turns
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")

import pytest

import auvsim  # noqa: F401

LONGEST = ("test_notebooks.py", "test_wheel.py")


def pytest_collection_modifyitems(items):
    """What takes longest begins first, so that no core waits for it at the end."""
    items.sort(key=lambda item: item.path.name not in LONGEST)


@pytest.fixture(scope="module")
def in_this_process():
    """A study's tasks run here: numba's code is loaded already, and nothing waits for processes that load it anew."""
    from in_turn import install

    with pytest.MonkeyPatch.context() as patch:
        install(patch)
        yield
