import subprocess
import sys

KERNEL_THEN_COUNT = """
import numpy as np, torch
from semgs.geometry.compiled import numba_threads
torch.set_num_threads(1)
from numba import njit, prange, get_num_threads

@njit(parallel=True)
def total(x):
    s = 0.0
    for i in prange(len(x)):
        s += x[i]
    return s

with numba_threads():
    assert get_num_threads() == 1, get_num_threads()
    total(np.ones(10))
assert torch.get_num_threads() == 1, torch.get_num_threads()
"""


def test_a_compiled_kernel_leaves_torchs_number_of_threads():
    """In a process of its own, since the first kernel starts the pool."""
    done = subprocess.run([sys.executable, "-c", KERNEL_THEN_COUNT], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
