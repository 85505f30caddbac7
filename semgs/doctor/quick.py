"""The quick test before a reconstruction: a few frames, a few hundred features each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from semgs.data.frames import Frame
from semgs.data.scene import Scene
from semgs.data.spread import spread
from semgs.doctor.diagnosis import diagnose
from semgs.doctor.mistakes import INVERSE_DEPTH, OF_DEPTH
from semgs.files.images.pictures import QUARTER_TURN, read_header
from semgs.runtime.notes import Kind, Note

MOST_FRAMES = 6
FEATURES = 400

MOST_HEADERS = 40
"""The headers of at most so many photos are read."""

MAY_BE_WRONG = Kind(
    "The {what} may be wrong. {found} semgs doctor tests all of the scene.", "The {what} may be wrong. {page}"
)
SLIGHTLY_WRONG = Kind("{found}")
ON_THEIR_SIDE = Kind(
    "Photos lie on their side, as EXIF says, and so do their cameras ({count} of {tested} tested). Classes and depth are worse in such photos, "
    "and up may be wrong. Turn the photos, then estimate their cameras again."
)


@dataclass(frozen=True)
class QuickTest:
    """What the quick test found.

    Attributes:
        warnings: for the user, if photos lie on their side, or the cameras or depth maps do not fit the images; none if all fits or nothing can be said.
        fits: whether the cameras fit matches between the images, or a usual mistake explains why not. Otherwise cameras that are slightly different may
            fit better, even if depth maps agree or there are too few matches for this test.
    """

    warnings: list[Note]
    fits: bool


def quick_test(scene: Scene, frames: Sequence[int], *, refined: bool = False, inverse: bool = False) -> QuickTest:
    """Test the cameras of a few frames.

    So few frames have few matches, so cameras are called slightly wrong only if most pairs of frames say so.

    Args:
        scene: the scene.
        frames: positions of the frames that are used; the first `MOST_FRAMES` are tested.
        refined: whether their cameras were refined already. Then nothing is said of slightly wrong ones.
        inverse: whether the user says that depth maps are inverse depth. Then nothing is said of that.

    Raises:
        InputError: an image or a depth map cannot be read.
    """
    tested = tuple(frames[:MOST_FRAMES])
    warnings = notes_on_sides([scene.frames[position] for position in tested])
    found = diagnose(scene, tested, FEATURES)
    stated = inverse and found.finding is not None and found.finding.mistake is INVERSE_DEPTH
    if found.verdict == "suspicious" and not stated:
        wrong = "depth maps" if found.finding is not None and found.finding.mistake in OF_DEPTH else "cameras"
        warnings.append(MAY_BE_WRONG(what=wrong, found=found.sentence, page=found.without_options))
    if found.verdict == "slightly wrong" and found.evidence.contradicts(found.given) and not refined:
        warnings.append(SLIGHTLY_WRONG(found=found.without_options))
    matched = len(found.evidence.matches) > 0 and not found.evidence.contradicts(found.given)
    return QuickTest(warnings, matched or found.finding is not None)


def frames_to_test(chosen: Sequence[int], count: int) -> tuple[int, ...]:
    """Positions of the frames to test: those that are used, then others of the scene, evenly chosen, as two or three frames are too few to tell mistakes apart.

    Args:
        chosen: positions of the frames that are used.
        count: of the scene's frames.
    """
    return tuple(dict.fromkeys((*chosen, *spread(range(count), MOST_FRAMES))))[:MOST_FRAMES]


def notes_on_sides(frames: Sequence[Frame]) -> list[Note]:
    """A note if EXIF says that photos are to be shown turned by a quarter, and their cameras are for the pixels as stored, as COLMAP's are.

    Raises:
        InputError: an image cannot be read.
    """
    tested = spread(frames, MOST_HEADERS)
    headers = [(frame.lens.size, read_header(frame.picture)) for frame in tested]
    count = sum(header.orientation >= QUARTER_TURN and header.size == size for size, header in headers)
    if not count:
        return []
    return [ON_THEIR_SIDE(count=count, tested=len(tested))]
