#!/usr/bin/env python3
# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Make the pictures of the README from real runs, with the commands that a user has.

    pip install '.[plot,render]' && python docs/make_pictures.py

Every run gives the same pictures: the simulation repeats to the bit, and so do plots.
"""

from collections.abc import Sequence
from pathlib import Path
import subprocess
import sys
import tempfile

from PIL import Image, ImageDraw, ImageFont

PICTURES = Path(__file__).resolve().parent / 'pictures'
QUALITY = 90        # of JPEG: 20 to 110 kB a picture
INK = (60, 66, 72)


def rigid_sim(*words: object) -> None:
    """Run the command line of this environment."""
    subprocess.run([sys.executable, '-m', 'rigid_sim_ros', *map(str, words)], check=True)


def frames(bag: Path, times: Sequence[float], size: tuple[int, int],
           *camera: object) -> list[Image.Image]:
    """Return pictures of a bag at some times [s], each with its time in a corner."""
    found = []
    for at in times:
        path = bag.parent / 'frame.png'
        rigid_sim('render', bag, '--output', path, '--at', at, '--size',
                  f'{2 * size[0]}x{2 * size[1]}', *camera)
        with Image.open(path) as image:
            frame = image.convert('RGB').resize(size, Image.Resampling.LANCZOS)
        ImageDraw.Draw(frame).text(
            (12, 8), f'{at:.2f} s', INK, font=ImageFont.load_default(17))
        found.append(frame)
    return found


def strip(pictures: Sequence[Image.Image], columns: int, name: str, gap: int = 4) -> None:
    """Write pictures side by side, line by line."""
    width, height = pictures[0].size
    rows = -(-len(pictures) // columns)
    whole = Image.new('RGB', (columns * (width + gap) - gap, rows * (height + gap) - gap), 'white')
    for k, picture in enumerate(pictures):
        row, column = divmod(k, columns)
        whole.paste(picture, (column * (width + gap), row * (height + gap)))
    whole.save(PICTURES / name, quality=QUALITY, optimize=True)


def main() -> None:
    """Make all of them."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        bags = {}
        for scene, seconds in (('tower', 3), ('t_handle', 10), ('pile_of_shapes', 3)):
            bags[scene] = Path(folder, scene)
            rigid_sim('batch', scene, '--duration', seconds, '--output', bags[scene])
        strip(frames(bags['tower'], (0.30, 0.55, 1.00), (400, 300), '--camera', 1.9, -2.2, 1.0,
                     '--look-at', 0.38, 0.0, 0.24), 3, 'tower.jpg')
        strip(frames(bags['t_handle'], (1.24, 1.64, 1.85, 1.95, 2.06, 2.47), (198, 220),
                     '--camera', 0.15, -0.22, 0.07, '--look-at', 0, 0, -0.01), 6, 't_handle.jpg')
        strip(frames(bags['pile_of_shapes'], (0.60, 2.40), (602, 380), '--camera', 2.5, -3.0, 1.8,
                     '--look-at', 0, 0, 0.15), 2, 'pile.jpg')
        rigid_sim('plot', bags['tower'], '--output', PICTURES / 'plot.png', '--bodies', 'ball',
                  '--bodies', 'block_9_*', '--duration', 1.6, '--quantity', 'position',
                  '--quantity', 'energy', '--quantity', 'contact_force', '--quantity', 'velocity')
    with Image.open(PICTURES / 'plot.png') as image:
        fewer = image.convert('RGB').quantize(64)       # half the bytes, and looks the same
    fewer.save(PICTURES / 'plot.png', optimize=True)
    for path in sorted(PICTURES.iterdir()):
        print(f'{path.name}: {path.stat().st_size / 1000:.0f} kB')


if __name__ == '__main__':
    main()
