"""Generated Python, its compilation and its cache."""

import os
import subprocess
import sys
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from estimators.core.compiling import cache_folder, load
from estimators.core.errors import ParameterError
from estimators.core.kernels import python_source

ROOT = Path(__file__).parents[2]


def test_every_operation_equals_casadi():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    unary = [ca.exp, ca.log, ca.sqrt, ca.sin, ca.cos, ca.tan, ca.sinh, ca.cosh, ca.tanh, ca.atan, ca.fabs, ca.sign]
    expressions = [f(x) for f in unary] + [ca.asin(x / 9), ca.acos(x / 9), -x, x * x, 2 * x, 1 / x, x**3.3, x**y]
    expressions += [x + y, x - y, x * y, x / y, ca.atan2(x, y), ca.fmin(x, y), ca.fmax(x, y), ca.sign(-x)]
    expressions += [x < y, x <= y, x == y, x != y, ca.logic_not(x > y), ca.logic_and(x < 1, y < 1)]
    expressions += [ca.logic_or(x < 1, y < 1), ca.if_else(x < y, x, y)]
    function = ca.Function("all", [x, y], [ca.vertcat(*expressions)])
    namespace: dict = {"math": __import__("math")}
    exec(python_source(function, "evaluate", ("x", "y"), ("out",), scalars=("x", "y")), namespace)
    for point in [(0.7, 1.9), (1.9, 0.7), (0.5, 0.5)]:
        out = np.full(len(expressions), np.nan)
        namespace["evaluate"](*point, out)
        assert out == pytest.approx(np.array(function(*point)).ravel(), rel=1e-14)  # two mathematical libraries


def test_only_structural_nonzeros_are_written():
    x = ca.SX.sym("x", 2)
    source = python_source(ca.Function("f", [x], [ca.diag(x)]), "f", ("x",), ("F",))
    assert "F[0, 0]" in source
    assert "F[1, 1]" in source
    assert "F[0, 1]" not in source


def test_unknown_operation_is_named():
    x = ca.SX.sym("x")
    with pytest.raises(ParameterError, match="no Python form of CasADi operation"):
        python_source(ca.Function("f", [x], [ca.erf(x)]), "f", ("x",), ("y",))


def test_cache_folder_follows_the_environment(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert cache_folder() == tmp_path / "auvsim"


def test_source_is_written_once_and_whole(monkeypatch, tmp_path):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    first = load("one", "value = 1\n")
    (path,) = (tmp_path / "auvsim").glob("*.py")
    written = path.stat().st_mtime_ns
    del sys.modules[first.__name__]
    assert load("one", "value = 1\n").value == 1
    assert path.stat().st_mtime_ns == written  # a new date would void the machine code kept with it
    del sys.modules[first.__name__]
    path.write_text("val")  # a file cut short
    assert load("one", "value = 1\n").value == 1
    assert load("one", "value = 2\n").value == 2
    assert not list((tmp_path / "auvsim").glob("*.tmp"))


def test_without_a_writable_folder_the_source_is_kept_in_memory(monkeypatch, tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("XDG_CACHE_HOME", str(blocked))
    source = "from estimators.core.compiling import compiled\n\n\n@compiled\ndef double(x):\n    return 2.0 * x\n"
    assert load("blocked", source).double(3.0) == 6.0


def test_processes_share_the_cache(tmp_path):
    """Three processes at once on an empty cache, then a fourth that finds it warm."""
    code = (
        "import time\nfrom estimators.planar import model as m\n"
        "was = m.is_warm()\nstart = time.perf_counter()\nm.warm()\n"
        "print(was, m.is_warm(), time.perf_counter() - start)"
    )
    environment = os.environ | {"XDG_CACHE_HOME": str(tmp_path), "PYTHONPATH": str(ROOT)}

    def started():
        return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE, text=True)

    together = [started() for _ in range(3)]
    cold = [process.communicate()[0].split() for process in together]
    assert [process.returncode for process in together] == [0, 0, 0]
    assert cold[0][1] == "True"
    was, now, seconds = started().communicate()[0].split()
    assert (was, now) == ("True", "True")
    # Loading takes 0.3 s where compiling takes 3 s; compared with each other, so that a slow machine does not matter.
    assert float(seconds) < 0.5 * min(float(line[2]) for line in cold)
