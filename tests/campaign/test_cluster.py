"""Dask as the engine: the same as on this machine's own processes, also where workers or the scheduler are killed."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import psutil
import pytest
from campaign_jobs import ENDINGS, misbehave

from auvsim.base.errors import AuvsimError, InputError
from auvsim.campaign import execution
from auvsim.campaign.cluster import Cluster
from auvsim.campaign.folder import open_folder
from auvsim.campaign.local import Pool
from auvsim.campaign.plan import Plan

pytest.importorskip("distributed", reason="no Dask: pip install 'auvsim[cluster]'")
Planned = Callable[..., Plan]


@pytest.fixture(scope="module")
def cluster() -> Iterator[Cluster]:
    """On this machine."""
    with Cluster(None, 2) as started:
        yield started


def tables(path: Path) -> list[bytes]:
    """What must be the same in each run."""
    return [(path / name).read_bytes() for name in ("table.parquet", "table.csv")]


@pytest.mark.usefixtures("light")
def test_the_same_table_as_with_processes(cluster: Cluster, planned: Planned, tmp_path: Path) -> None:
    """Byte for byte, with a stopping rule, a trial that hangs and one that kills its process."""
    plan = planned("kill:2,5", trials=18, stop={"width": 0.4, "block": 6})
    done = execution.run(plan, tmp_path / "dask", cluster)
    assert (done.state["engine"], done.state["jobs"]) == ("dask", 2)
    with Pool(1) as pool:
        assert execution.run(plan, tmp_path / "local", pool).state["stopped"] == done.state["stopped"]
    assert tables(tmp_path / "dask") == tables(tmp_path / "local")


def test_deaths_are_told_apart(cluster: Cluster) -> None:
    """As by a pool of processes; no Dask worker dies of them."""
    workers = set(cluster._client.run(os.getpid).values())
    found = dict(cluster.run(misbehave, [1, *ENDINGS, 2, 3], timeout=1.0))
    assert {task: found[task] for task in (1, 2, 3)} == {1: 1, 2: 2, 3: 3}
    assert {task: found[task].hung for task in ENDINGS} == dict.fromkeys(ENDINGS, False) | {"hang": True}
    assert found["kill"].reason == "was killed by signal 9"
    assert set(cluster._client.run(os.getpid).values()) == workers


def test_kill_9_of_a_dask_worker_loses_nothing(cluster: Cluster, tmp_path: Path) -> None:
    """Its tasks run elsewhere or in its successor."""
    before = set(cluster._client.run(os.getpid).values())
    tasks = [("minder", str(tmp_path), 0), *range(20)]
    assert dict(cluster.run(misbehave, tasks, timeout=30.0)) == {task: task for task in tasks}
    assert set(cluster._client.run(os.getpid).values()) != before


@pytest.fixture
def elsewhere(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """Address and processes of a scheduler and a worker of two threads, as on other machines."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{probe.getsockname()[1]}"
    port = address.rpartition(":")[2]
    commands = [
        ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", port, "--no-dashboard", "--no-show"],
        ["distributed.cli.dask_worker", address, "--nthreads", "2", "--no-dashboard", "--local-directory", tmp_path],
    ]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    processes = [subprocess.Popen([sys.executable, "-m", *map(str, command)], **quiet) for command in commands]
    yield address, processes
    for process in reversed(processes):
        process.terminate()
        process.wait(20.0)


@pytest.mark.usefixtures("light")
def test_kill_9_of_the_scheduler_loses_nothing_that_was_finished(
    elsewhere: tuple[str, list[subprocess.Popen]], planned: Planned, tmp_path: Path
) -> None:
    """One line says so; without the cluster the campaign goes on, and its table is that of a run without trouble."""
    address, (scheduler, _) = elsewhere
    plan = planned("slow:" + ",".join(map(str, range(3, 12))))

    def kill_it(progress: execution.Progress) -> None:
        if progress.done == 8:
            scheduler.kill()

    with Cluster(address, 1) as cluster:
        assert cluster.jobs == 2
        with pytest.raises(AuvsimError, match=r"the Dask .* is lost.*; what is finished is kept"):
            execution.run(plan, tmp_path / "c", cluster, kill_it)
    finished = {path: path.read_bytes() for path in tmp_path.glob("c/trials/*/*/0*.json")}
    assert 8 <= len(finished) < 24
    assert not open_folder(tmp_path / "c").state["complete"]
    with Pool(2) as pool:
        execution.run(plan, tmp_path / "c", pool)
        execution.run(plan, tmp_path / "unharmed", pool)
    assert finished.items() <= {path: path.read_bytes() for path in tmp_path.glob("c/trials/*/*/0*.json")}.items()
    assert tables(tmp_path / "c") == tables(tmp_path / "unharmed")


def test_a_cluster_without_any_worker_left_ends(
    elsewhere: tuple[str, list[subprocess.Popen]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It waits a while for others, then one line says so; what was done is given before."""
    address, (_, worker) = elsewhere
    with Cluster(address, 1) as cluster:
        monkeypatch.setattr("auvsim.campaign.cluster.CONNECTING", 3.0)
        monkeypatch.setattr("auvsim.campaign.cluster.WATCH", 0.5)
        outcomes = cluster.run(misbehave, [1, ("sleep", 60.0), ("sleep", 60.0)], timeout=90.0)
        assert next(outcomes) == (1, 1)
        for process in [*psutil.Process(worker.pid).children(recursive=True), worker]:
            process.kill()
        with pytest.raises(AuvsimError, match=r"^the Dask cluster has lost all workers; what is finished is kept"):
            next(outcomes)


def test_no_cluster_there(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line, soon."""
    monkeypatch.setattr("auvsim.campaign.cluster.CONNECTING", 1.0)
    started = time.monotonic()
    with pytest.raises(InputError, match=r"no Dask cluster at tcp://127\.0\.0\.1:9: "):
        Cluster("tcp://127.0.0.1:9", 1)
    assert time.monotonic() - started < 20.0
