"""Files with cameras of other programs that are not read, found beside images, so that notes and errors can name them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

OTHER_CAMERAS = (
    ("*.xml", b"<chunk", "Metashape"),
    ("poses_bounds*.npy", b"NUMPY", "LLFF"),
    ("sfm_data*.json", b"sfm_data_version", "OpenMVG"),
    ("*.sfm", b"{", "AliceVision (Meshroom)"),
    ("sfm*.json", b"featuresFolders", "AliceVision (Meshroom)"),
    ("*.csv", b"#name,x,y", "RealityScan (RealityCapture)"),
    ("bundle*.out", b"Bundle", "Bundler"),
    ("*.nvm", b"NVM", "VisualSFM"),
    ("reconstruction.json", b"shots", "OpenSfM"),
    ("*calibrated_camera_parameters.txt", b"", "Pix4D"),
    ("*.psx", b"", "Metashape"),
    ("camera_poses.txt", b"", "VGGT-Long"),
    ("*.traj", b"", "ARKitScenes"),
    ("*_cam.txt", b"extrinsic", "MVSNet"),
    ("*/*_cam.txt", b"extrinsic", "MVSNet"),
    ("*_poses.txt", b"#timestamp", "RTAB-Map (of the robot; rtabmap-export --poses_camera writes those of the camera)"),
    ("calib.txt", b"P0", "KITTI"),
    ("cameras*.npz", b"world_mat", "NeuS (IDR)"),
    ("cameras.json", b'"rotation"', "3DGS"),
    ("meta_data.json", b"camtoworld", "SDFStudio"),
    ("*/sensor.yaml", b"T_BS", "EuRoC"),
)
"""Name, what the beginning contains, program."""

MAP_FOLDERS = ("depth", "depths", "confidence")
"""Folders of recordings whose pictures are no photos, in lower case."""


def cameras_beside(folders: Iterable[Path]) -> list[tuple[str, str]]:
    """The files in some folders that have cameras of other programs, each as its name and the program; one file of each kind."""
    found: dict[str, str] = {}
    for folder in folders:
        for pattern, start, program in OTHER_CAMERAS:
            if program in found.values():
                continue
            file = next((one for one in sorted(folder.glob(pattern)) if start in _beginning(one)), None)
            if file is not None:
                found.setdefault(file.relative_to(folder).as_posix(), program)
    return list(found.items())


def stray_scanner_clip(folder: Path) -> Path | None:
    """The clip of a capture of the app Stray Scanner, None if a folder is none. Its cameras are not read."""
    clip = folder / "rgb.mp4"
    return clip if clip.is_file() and (folder / "odometry.csv").is_file() else None


def _beginning(file: Path) -> bytes:
    """The first bytes of a file; empty if it cannot be read."""
    try:
        with file.open("rb") as opened:
            return opened.read(4096)
    except OSError:
        return b""
