# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The pictures of the documents: all shown somewhere, and small enough for a README."""
from pathlib import Path

from PIL import Image
import pytest

ROOT = Path(__file__).parents[2]
PICTURES = sorted((ROOT / 'docs' / 'pictures').iterdir())
DOCUMENTS = [ROOT / 'README.md', *(ROOT / 'docs').glob('*.md')]


@pytest.mark.parametrize('path', PICTURES, ids=lambda path: path.name)
def test_a_picture_can_be_opened_is_small_and_is_shown(path: Path) -> None:
    with Image.open(path) as image:
        image.verify()
        assert image.width > 800
    assert path.stat().st_size < 200_000
    assert any(f'pictures/{path.name})' in text.read_text(encoding='utf-8') for text in DOCUMENTS)


def test_all_pictures_together_are_small() -> None:
    assert sum(path.stat().st_size for path in PICTURES) < 800_000
