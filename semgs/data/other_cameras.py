"""Files with cameras of other programs that are not read, found beside images, so that notes and errors can name them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from semgs.files.paths import not_hidden
from semgs.files.text import listed

OPEN3D = "Open3D"

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
    ("*.json", b"PinholeCameraTrajectory", OPEN3D),
)
"""Name, what the beginning contains, program."""

AS_LOG = (
    "write them as trajectory.log (open3d.io.write_pinhole_camera_trajectory) and their intrinsics as intrinsic.json (write_pinhole_camera_intrinsic), or all of "
    "it as transforms.json (docs/conventions.md)"
)
"""What to do about cameras of Open3D."""

DROID_SLAM = ("images.npy", "poses.npy", "intrinsics.npy")
"""Files that DROID-SLAM writes."""

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


def arrays_inside(folder: Path) -> str | None:
    """What to do about a folder of arrays, such as DROID-SLAM's; None for other folders."""
    arrays = [one.name for one in not_hidden(folder.iterdir()) if one.suffix.lower() in (".npy", ".npz")]
    advice = "are not read; load them and give them to semgs.Views.from_arrays (docs/examples/arrays_in.md)"
    if set(DROID_SLAM) <= set(arrays):
        return (
            f"{', '.join(arrays)} are arrays of DROID-SLAM, which {advice}: its poses are world to camera (t, then x, y, z, w), its intrinsics for images of 1/8 of "
            "the size, and its images BGR"
        )
    return f"{listed(arrays)} are arrays, which {advice}" if arrays else None


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
