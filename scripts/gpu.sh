#!/usr/bin/env bash
# Tests, benchmarks and training on a machine with a CUDA GPU. Downloads nothing.
#
#   scripts/gpu.sh test                          the tests marked gpu (under 5 minutes, after gsplat has been compiled once)
#   scripts/gpu.sh time                          python -m paper.bench, whose rows that end in _cuda run on the GPU
#   scripts/gpu.sh train small runs/night 8      train for 8 minutes; to resume, repeat the command
#   scripts/gpu.sh all                           tests, then times
#
# PYTHON is an interpreter with torch 2.11 or newer for CUDA (python3). Missing packages (gsplat, cyclopts, lightning-fabric, beartype, ...) can be
# provided as wheels in the folder WHEELS. They are installed to build/gpu, without changing the interpreter.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."
python=${PYTHON:-python3}
task=${1:-all}

if [ -n "${WHEELS:-}" ]; then
    "$python" -m pip install -q --disable-pip-version-check --no-index --no-deps --upgrade --target build/gpu "$WHEELS"/*.whl
    export PYTHONPATH="$PWD/build/gpu${PYTHONPATH:+:$PYTHONPATH}"
fi
export PYTHONPATH="$PWD${PYTHONPATH:+:$PYTHONPATH}" PYTHONUNBUFFERED=1

"$python" - <<'CHECK'
import sys
import torch

if not torch.cuda.is_available():
    sys.exit(f"torch {torch.__version__} finds no CUDA device here")
print(f"torch {torch.__version__} on {torch.cuda.get_device_name()}")
CHECK
TORCH_CUDA_ARCH_LIST=${TORCH_CUDA_ARCH_LIST:-$("$python" -c 'import torch; print("%d.%d" % torch.cuda.get_device_capability())')}
export TORCH_CUDA_ARCH_LIST
# Compiles the extension of gsplat, once per machine.
"$python" -c 'from semgs.rendering.gsplat_backend import rasterizer; rasterizer()' \
    || echo 'gsplat does not work here; tests that need it are skipped, rendering uses the CPU' >&2

marked=$(grep -rl --include='test_*.py' 'mark\.gpu' tests)  # the others need packages for development only

case $task in
    test) "$python" -m pytest -m gpu -rs $marked ;;
    time) "$python" -m paper.bench ;;
    train) "$python" -m semgs train "$2" --out "$3" --device cuda --minutes "$4" "${@:5}" ;;
    all) "$python" -m pytest -m gpu -rs $marked && "$python" -m paper.bench ;;
    *) echo "unknown task $task: test, time, train or all" >&2; exit 2 ;;
esac
