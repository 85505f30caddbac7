"""Errors planted in `semgs/files`."""

from __future__ import annotations

from planted.mutant import Mutant

OF_SFM = "tests/sfm/test_"
FOLDERS = "semgs/files/folders.py"

FILES = (
    Mutant(
        "a pointer of Git LFS is taken for the file", "semgs/files/contents.py",
        "if beginning.startswith(LFS_POINTER):", "if beginning == LFS_POINTER:", ("tests/files/test_contents.py",),
    ),
    Mutant(
        "zip members are inflated whole, whatever size they list", "semgs/files/archives.py",
        ".decompress(data, self.size + 1)", ".decompress(data)", ("tests/files/test_archives.py",),
    ),
    Mutant(
        "backslashes in a zip are letters of a name", "semgs/files/archives.py",
        r'one.filename.replace("\\", "/")', "one.filename", ("tests/files/test_archives.py",),
    ),
    Mutant(
        "of two members of one name but its form of Unicode the last is read", "semgs/files/archives.py",
        "None if form in forms else member", "member", ("tests/files/test_archives.py",),
    ),
    Mutant(
        "counts of a PGM have their low byte first", "semgs/files/images/pictures.py",
        'np.frombuffer(data, ">u2"', 'np.frombuffer(data, "<u2"',
        ("tests/files/test_pictures.py::test_counts_of_a_pgm_are_taken_as_they_are",),
    ),
    Mutant(
        "of a key that appears twice the last counts", "semgs/files/strict_json.py",
        "if len(content) < len(pairs):", "if False:", ("tests/files/test_strict_json.py",),
    ),
    Mutant(
        "the colours of a class map are one class off", "semgs/files/images/colours.py",
        "palette[: len(colours)] = colours", "palette[1 : len(colours) + 1] = colours", ("tests/test_in_a_notebook.py",),
    ),
    Mutant(
        "an old folder loses its name before the new one has it", FOLDERS,
        "if _exchange(staging, target):", "if False:",
        ("tests/files/test_folders.py::test_a_kill_right_after_the_first_rename_leaves_a_whole_folder_under_the_name",),
    ),
    Mutant(
        "two processes may have one folder", FOLDERS,
        "lock.acquire(timeout=0)\n    except Timeout as error", "lock.is_locked\n    except Timeout as error",
        ("tests/files/test_folders.py::test_one_process_at_a_time_has_a_folder",),
    ),
    Mutant(
        "a mount point is found after the work", FOLDERS,
        "if target.is_mount():", "if False:",
        ("tests/files/test_folders.py::test_a_mount_point_is_told_before_the_work",),
    ),
    Mutant(
        "a folder whose record has more settings is gone on with", "semgs/files/claims.py",
        "set(there) != set(settings)", "set(there) < set(settings)",
        ("tests/files/test_claims.py::test_a_record_of_something_else_is_refused",),
    ),
    Mutant(
        "the equivalent focal length compares widths", "semgs/files/images/pictures.py",
        "equivalent * math.hypot(*image.size) / _DIAGONAL_35_MM", "equivalent * max(image.size) / 36",
        (f"{OF_SFM}photos.py::test_a_focal_length_of_26_mm_compares_diagonals",),
    ),
    Mutant(
        "greys of four bits are scaled", "semgs/files/images/pictures.py",
        "_SCALED = {2: 85, 4: 17}", "_SCALED = {}", ("tests/files/test_maps_of_any_png.py",),
    ),
    Mutant(
        "indices of a palette of greys are the numbers", "semgs/files/images/pictures.py",
        "return palette[:, 0][indices]", "return indices", ("tests/files/test_maps_of_any_png.py",),
    ),
    Mutant(
        "masks of 0 and 1 hide everything", "semgs/files/images/pictures.py",
        "numbers > (0 if few else full // 2)", "numbers > full // 2", ("tests/files/test_maps_of_any_png.py",),
    ),
)  # fmt: skip
