"""What a worker of a batch needs, and how many workers a machine has room for."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Demands:
    """What a worker needs, besides a core.

    Attributes:
        memory: peak of its process [bytes].
        gpu: the part of a GPU, 0 to 1; 0 computes on the CPU.
    """

    memory: float
    gpu: float = 0.0

    def workers(self, cores: int, free: float) -> int:
        """How many workers fit into a machine, at least one.

        Args:
            cores: that may be used.
            free: memory [bytes].
        """
        most = min(cores, free / self.memory)
        return max(1, int(min(most, 1 / self.gpu) if self.gpu else most))
