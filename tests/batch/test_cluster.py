"""A batch on a Ray cluster of two nodes on this machine."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from semgs.batch.cluster import run_on_cluster
from semgs.batch.records import Record
from semgs.batch.tasks import Demands, Task
from semgs.cli.main import main
from semgs.run.export import Export

ray = pytest.importorskip("ray", reason="Ray is not installed; pip install -e '.[cluster]' in SemGS's folder")

pytestmark = [
    pytest.mark.long,
    pytest.mark.timeout(1500),
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::DeprecationWarning", "ignore::FutureWarning"),
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
]

NODE = {"num_cpus": 2, "memory": 3_000_000_000, "object_store_memory": 80_000_000, "include_dashboard": False}


@pytest.fixture
def cluster(monkeypatch: pytest.MonkeyPatch) -> Iterator[object]:
    """Two nodes."""
    from ray.cluster_utils import Cluster

    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).resolve().parents[2]), prepend=":")
    made = Cluster(initialize_head=True, head_node_args={**NODE, "num_cpus": 1})
    try:
        made.add_node(**{**NODE, "num_cpus": 1})
        yield made
    finally:
        made.shutdown()


def test_forty_rooms_are_done_although_a_node_is_killed_on_the_way(
    cluster, tmp_path: Path, capsys: pytest.CaptureFixture[str]
):
    rooms, out = tmp_path / "rooms", tmp_path / "out"
    assert main(["rooms", str(rooms), "--scenes", "40", "--size", "48x64", "--frames", "4", "--workers", "0"]) == 0

    def kill_a_node() -> None:
        while len(list(out.glob("records/*.json"))) < 8:
            time.sleep(0.2)
        cluster.remove_node(next(iter(cluster.worker_nodes)), allow_graceful=False)

    thread = threading.Thread(target=kill_a_node, daemon=True)
    thread.start()
    assert main(["batch", "reconstruct", str(rooms), "--out", str(out), "--ray", cluster.address]) == 0
    assert not thread.is_alive()
    assert "40 of 40 scenes succeeded" in capsys.readouterr().out
    assert len(list(out.glob("scene_*/report.json"))) == 40
    assert list(out.rglob(".*.part")) == []


def set_up_nothing() -> None:
    pass


def write_nothing(task: Task) -> Record:
    return Record(task.name, task.fingerprint, 0)


def test_a_task_that_no_machine_has_room_for_is_refused(cluster):
    task = Task(
        "hall",
        Path("scans/hall"),
        Path("out"),
        "hall",
        "export",
        Export(scene=Path("scans/hall"), out=Path("out/hall")),
        "x",
    )
    with pytest.raises(ValueError, match=r"no machine of the cluster has a core, 900.0 GB of memory"):
        next(run_on_cluster(write_nothing, [task], cluster.address, Demands(9e11), set_up_nothing))
