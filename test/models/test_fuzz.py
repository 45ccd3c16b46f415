# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Whatever a file of a model holds: it becomes a scene, or is refused; nothing else happens."""

import random
import re
import warnings

from effort import either
from models.robots import URDF, write
from models.test_sdf import ARM, link, sdf
from models.test_urdf import CAMERA, MIMIC
import pytest

from rigid_sim_ros.scene import read_scene, SceneError

NESTED = sdf(link('base') + '<frame name="f"><pose>0 0 1 0 0 0</pose></frame><model name="hand" '
             f'placement_frame="g"><pose relative_to="f">1 0 0 0 0 0</pose>{link("palm")}<frame '
             'name="g" attached_to="palm"><pose>0 0 1 0 0 1</pose></frame></model><joint name="j" '
             'type="universal"><parent>base</parent><child>hand::palm</child><axis><xyz>0 0 1'
             '</xyz></axis><axis2><xyz>1 0 0</xyz></axis2></joint>')
TEXTS = {'urdf': (URDF, MIMIC, CAMERA), 'sdf': (ARM, NESTED)}
WORDS = ('', '0', '-1', '1e308', 'nan', 'inf', '-inf', '1e-320', '99999999999999999999', 'base',
         'rod', 'world', '__model__', '::', 'a::b', '/', 'x/y', '..', '%00', '\u00e9',
         '\U0001f600', 'true', '0 0 0', '1 2 3 4', 'package://', 'model://x', 'file:///dev/zero',
         'fixed', 'floating',
         'planar', 'prismatic', 'continuous', 'ball', 'x' * 300, '&amp;', '&lt;', '2' * 400)


def mutated(text: str, rng: random.Random) -> str:
    """Return a text with one to four changes: values, elements, letters."""
    for _ in range(rng.randint(1, 4)):
        kind = rng.randrange(6)
        if kind == 0:       # another value of an attribute
            found = list(re.finditer('"([^"]*)"', text))
        elif kind == 1:     # another text of an element
            found = list(re.finditer('>([^<>]+)<', text))
        elif kind in (2, 3):    # an element goes, with its content, or is there twice
            found = list(re.finditer(r'(<(\w+)[^>]*?(?:/>|>[^<]*</\2>))', text))
        elif kind == 4:     # another name of an element or an attribute
            found = list(re.finditer(r'<(\w+)|\s(\w+)=', text))
        else:       # a letter less
            found = [match for match in re.finditer('.', text) if rng.random() < 0.02]
        if not found:
            continue
        match = rng.choice(found)
        group = 1 if match.re.groups and match.group(1) is not None else match.re.groups
        start, end = match.span(group)
        new = {2: '', 3: 2 * text[start:end], 5: ''}.get(kind, rng.choice(WORDS))
        text = text[:start] + new + text[end:]
    return text


@pytest.mark.long
@pytest.mark.parametrize('seed', range(either(6, 120)))
@pytest.mark.parametrize('kind', TEXTS)
def test_a_damaged_file_becomes_a_scene_or_is_refused(tmp_path, kind, seed) -> None:
    rng = random.Random(f'{kind} {seed}')
    path = tmp_path / f'm.{kind}'
    read, refused = 0, 0
    for _ in range(100):
        path.write_text(mutated(rng.choice(TEXTS[kind]), rng), encoding='utf-8')
        try:
            with warnings.catch_warnings():
                warnings.simplefilter('error')
                read_scene(path)
            read += 1
        except SceneError as error:
            assert all('\n' not in str(problem) for problem in error.problems)
            refused += 1
    # Both happen, or the changes are not worth their name.
    assert read > 3
    assert refused > 30


def test_bytes_that_are_no_text_are_refused(tmp_path) -> None:
    rng = random.Random(7)
    for kind in TEXTS:
        path = write(tmp_path, f'm.{kind}', '')
        for _ in range(50):
            path.write_bytes(rng.randbytes(rng.randrange(200)))
            with pytest.raises(SceneError):
                read_scene(path)
