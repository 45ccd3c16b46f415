# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Pictures to a film, MP4 with H.264, by PyAV: FFmpeg comes in its wheels."""

from collections.abc import Iterable
from fractions import Fraction
from pathlib import Path
from typing import Any

import av

# 0 keeps everything, 51 almost nothing; 18 cannot be told from the pictures.
_QUALITY = '20'


def write_film(path: Path, pictures: Iterable[Any], fps: float, size: tuple[int, int]) -> int:
    """
    Write pictures, (height, width, 3) bytes each, and return how many there were.

    Width and height must be even: H.264 halves the resolution of the colours. OSError.
    """
    count = 0
    with av.open(str(path), 'w', options={'movflags': 'faststart'}) as file:
        stream: Any = file.add_stream('libx264', rate=Fraction(fps).limit_denominator(1000))
        stream.width, stream.height = size
        stream.pix_fmt = 'yuv420p'      # what browsers and players take
        stream.options = {'crf': _QUALITY}
        for picture in pictures:
            frame = av.VideoFrame.from_ndarray(picture, format='rgb24')
            file.mux(stream.encode(frame))
            count += 1
        file.mux(stream.encode(None))
    return count
