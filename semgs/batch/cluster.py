"""The tasks of a batch on a Ray cluster, whose machines share a file system and have the same SemGS installed."""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence

from semgs.batch.records import Record
from semgs.batch.tasks import Demands, Task
from semgs.files.errors import needs_extra
from semgs.runtime.workers import TRIES


def check_ray() -> None:
    """Check that Ray is installed.

    Raises:
        ImportError: it is not; the message names the extra.
    """
    with needs_extra("cluster", "--ray needs Ray", "ray"):
        import ray  # noqa: F401


def run_on_cluster(
    work: Callable[[Task], Record], tasks: Sequence[Task], address: str, demands: Demands, settle: Callable[[], None]
) -> Generator[tuple[int, Record | Exception], None, None]:
    """Run tasks on a Ray cluster, as `semgs.runtime.workers.finished` does on this machine. Those that run end when the generator is closed.

    Args:
        work: runs a task; picklable.
        tasks: to run.
        address: of the cluster ("10.0.0.1:6379"), or "auto" for the one that this machine belongs to.
        demands: what each task needs besides a core.
        settle: sets up the process of a task, before each; picklable.

    Yields:
        The position of a task, and its record or why its processes ended, as they come.

    Raises:
        ConnectionError: there is no cluster at the address.
        ValueError: no machine of the cluster has what a task needs.
    """
    import ray

    ray.init(address, log_to_driver=False, logging_level="error")
    try:
        if not any(_fits(node["Resources"], demands) for node in ray.nodes() if node["Alive"]):
            gpu = " and a GPU" if demands.gpu else ""
            raise ValueError(f"no machine of the cluster has a core, {demands.memory / 1e9:.1f} GB of memory{gpu}")
        remote = ray.remote(_settled).options(
            num_cpus=1, num_gpus=demands.gpu, memory=int(demands.memory), max_retries=TRIES - 1, name="semgs batch"
        )
        positions = {remote.remote(work, settle, task): position for position, task in enumerate(tasks)}
        while positions:
            for reference in ray.wait(list(positions))[0]:
                position = positions.pop(reference)
                try:
                    yield position, ray.get(reference)
                except ray.exceptions.RayError as error:
                    yield position, ChildProcessError(" ".join(str(error).split()))
    finally:
        ray.shutdown()


def _fits(resources: Mapping[str, float], demands: Demands) -> bool:
    """Whether a machine with these resources can run a task."""
    needed = {"CPU": 1, "memory": demands.memory, "GPU": demands.gpu}
    return all(resources.get(name, 0) >= amount for name, amount in needed.items())


def _settled(work: Callable[[Task], Record], settle: Callable[[], None], task: Task) -> Record:
    """Set up the process, and run a task."""
    settle()
    return work(task)
