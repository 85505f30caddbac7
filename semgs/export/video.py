"""Videos: H.264 in MP4, by PyAV (extra `video`)."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np
from jaxtyping import UInt8

from semgs.files.errors import needs_extra
from semgs.files.folders import staged

CRF = "18"
"""Constant quality: visually lossless."""

BT709, LIMITED_RANGE = 1, 1
"""Numbers of the colour space of HD video and of its range, 16..235. Without them in the file, players guess by the size of the image."""

NARROWEST, WIDEST = 2, 16384
"""Sides are even, and encoders refuse wider images [px]."""


def check_video_library() -> None:
    """Check that videos can be written.

    Raises:
        ImportError: PyAV is not installed.
    """
    _av()


def write_video(path: Path, frames: Iterable[UInt8[np.ndarray, "h w 3"]], fps: int) -> None:
    """Write a video that plays everywhere: H.264, yuv420p, with its index in front.

    Images with odd sides lose their last row or column: yuv420p needs even sides.

    Args:
        path: the file.
        frames: of one size, at least 2x2 and at most `WIDEST` wide, one after the other; at least one.
        fps: frames per second.

    Raises:
        ImportError: PyAV is not installed.
        OSError: the file cannot be written.
    """
    av = _av()
    try:
        with staged(path) as partial:
            with av.open(str(partial), "w", format="mp4", options={"movflags": "+faststart"}) as container:
                stream = None
                for frame in frames:
                    height, width = (side - side % 2 for side in frame.shape[:2])
                    if stream is None:
                        stream = container.add_stream("libx264", rate=fps, options={"crf": CRF, "preset": "medium"})
                        stream.height, stream.width, stream.pix_fmt = height, width, "yuv420p"
                        stream.codec_context.colorspace = stream.codec_context.color_primaries = BT709
                        stream.codec_context.color_trc = BT709
                        stream.codec_context.color_range = LIMITED_RANGE
                    rgb = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame[:height, :width]), format="rgb24")
                    container.mux(stream.encode(rgb.reformat(format="yuv420p", dst_colorspace="ITU709")))
                if stream is not None:
                    container.mux(stream.encode())
            partial.replace(path)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error  # with this name, not the temporary one


def _av():
    """PyAV.

    Raises:
        ImportError: it is not installed.
    """
    with needs_extra("video", "videos need PyAV", "av"):
        import av
    return av
