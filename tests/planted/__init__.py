"""The errors that `tests/mutants.py` plants, one module for each package of `semgs`.

Each is a mistake that someone has made or will make: a transpose, half a pixel, one camera for another. The text that it
replaces must occur exactly once in its file; a test of every run (`test_mutants.py`) says so when code has moved on.
"""

from __future__ import annotations

from planted.cli import CLI
from planted.data import DATA
from planted.doctor import DOCTOR
from planted.evaluation import EVALUATION
from planted.export import EXPORT
from planted.figures import FIGURES
from planted.files import FILES
from planted.geometry import GEOMETRY
from planted.mapping import MAPPING
from planted.model import MODEL
from planted.mutant import Mutant
from planted.objectives import OBJECTIVES
from planted.other_tools import OTHER_TOOLS
from planted.preparation import PREPARATION
from planted.reconstruction import RECONSTRUCTION
from planted.rendering import RENDERING
from planted.robotics import ROBOTICS
from planted.rooms import ROOMS
from planted.ros import ROS
from planted.scene import SCENE
from planted.segmenters import SEGMENTERS
from planted.sfm import SFM
from planted.splats import SPLATS
from planted.training import TRAINING
from planted.viewer import VIEWER
from planted.weights import WEIGHTS

__all__ = ["MUTANTS", "Mutant"]

MUTANTS: tuple[Mutant, ...] = (
    *CLI,
    *DATA,
    *DOCTOR,
    *EVALUATION,
    *EXPORT,
    *FIGURES,
    *FILES,
    *GEOMETRY,
    *MAPPING,
    *MODEL,
    *OBJECTIVES,
    *OTHER_TOOLS,
    *PREPARATION,
    *RECONSTRUCTION,
    *RENDERING,
    *ROBOTICS,
    *ROOMS,
    *ROS,
    *SCENE,
    *SEGMENTERS,
    *SFM,
    *SPLATS,
    *TRAINING,
    *VIEWER,
    *WEIGHTS,
)
