# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the README and the pages in docs/ show is what happens."""
from pathlib import Path
import re
import shlex

import fresh
import pytest
import yaml

from rigid_sim_ros import cli
from rigid_sim_ros.engine.dynamics.forces import FORCES
from rigid_sim_ros.scene import scene_from_text, schema
from rigid_sim_ros.scene.advice import advice

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / 'README.md', *sorted((ROOT / 'docs').glob('*.md'))]
TEXTS = {page.name: page.read_text(encoding='utf-8') for page in PAGES}
MOST_LINES = {'README.md': 150, 'performance.md': 200}


def blocks(page: str, language: str) -> list[str]:
    """Return what stands in fences of a language."""
    return re.findall(rf'^```{language}\n(.*?)^```$', TEXTS[page], re.MULTILINE | re.DOTALL)


# Programs, but for those of nodes, which test/nodes/test_examples.py runs.
PYTHON = [(page, code) for page in TEXTS for code in blocks(page, 'python') if 'rclpy' not in code]
SCENES = [(page, text) for page in TEXTS for text in blocks(page, 'yaml')]
COMMANDS = [words for page in TEXTS for code in blocks(page, 'bash') for line in code.splitlines()
            if (words := shlex.split(line, comments=True))[:1] == ['rigid_sim']]
LINKS = [(page, link) for page, text in TEXTS.items()
         for link in re.findall(r'\]\((?!http)(.*?)\)', text)]
# A command in scenes.md, and what it prints.
OUTPUTS = dict(re.findall(r'^```bash\n(rigid_sim [^\n]*)\n```\n\n```text\n(.*?)^```$',
                          TEXTS['scenes.md'], re.MULTILINE | re.DOTALL))
SPECS = (schema.World, schema.Bounds, schema.Body, schema.Inertial, schema.Material,
         schema.Collision, schema.Sphere, schema.Box, schema.Capsule, schema.Cylinder,
         schema.Cone, schema.Ellipsoid, schema.Plane, schema.Mesh, schema.Points,
         schema.Compound)


def trimmed(text: str) -> list[str]:
    """Return the lines without blanks at their ends and blank lines around them."""
    return [line.rstrip() for line in text.strip('\n').splitlines() if line.strip()]


def anchors(page: Path) -> set[str]:
    """Return what the headings of a page are called in links."""
    titles = re.findall('^#+ (.*)$', page.read_text(encoding='utf-8'), re.MULTILINE)
    return {re.sub(r'[^\w -]', '', title.lower()).replace(' ', '-') for title in titles}


@pytest.mark.parametrize('page', MOST_LINES)
def test_a_first_page_is_short(page: str) -> None:
    assert len(TEXTS[page].splitlines()) <= MOST_LINES[page]


@pytest.mark.parametrize('command', ['rigid_sim scenes', 'rigid_sim check spring_pendulum'])
def test_the_output_of_a_command_is_the_one_shown(command: str, capsys) -> None:
    with pytest.raises(SystemExit):
        cli.main(command.split()[1:])
    assert trimmed(capsys.readouterr().out) == trimmed(OUTPUTS[command])


@pytest.mark.parametrize('words', COMMANDS, ids=' '.join)
def test_the_options_of_a_command_that_is_shown_exist(words: list[str], capsys) -> None:
    own = words[:words.index('--ros-args')] if '--ros-args' in words else words
    with pytest.raises(SystemExit) as ended:
        cli.main([own[1], '--help'])
    assert ended.value.code == 0
    known = re.findall(r'^ +(--[\w-]+)', capsys.readouterr().out, re.MULTILINE)
    assert {word for word in own if word.startswith('--')} <= set(known)


def test_a_mistake_in_a_scene_is_reported_as_shown(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.chdir(tmp_path)
    Path('my_scene.yaml').write_text(
        'bodies:\n  - name: crate\n    shape: {type: sphere, radius: 1}\n    mass: -2.0\n',
        encoding='utf-8')
    with pytest.raises(SystemExit):
        cli.main(['check', 'my_scene.yaml'])
    assert capsys.readouterr().err in blocks('scenes.md', 'text')


@pytest.mark.parametrize(('page', 'code'), PYTHON, ids=[page for page, _ in PYTHON])
def test_the_python_that_is_shown_runs(page: str, code: str, tmp_path) -> None:
    result = fresh.run('-c', code, cwd=tmp_path)
    assert (result.returncode, result.stderr) == (0, '')
    assert result.stdout in ['', *blocks(page, 'text')]


@pytest.mark.parametrize(('page', 'text'), SCENES, ids=[page for page, _ in SCENES])
def test_a_scene_that_is_shown_loads_without_a_warning(page: str, text: str) -> None:
    assert advice(scene_from_text(text)) == []


@pytest.mark.parametrize('kind', FORCES)
def test_every_force_and_its_keys_stand_in_the_reference(kind: str) -> None:
    row, = re.findall(rf'^\| `{kind}` \|.*$', TEXTS['scenes.md'], re.MULTILINE)
    keys = {parameter.name for parameter in FORCES[kind].parameters}
    assert keys <= set(re.findall('`(.*?)`', row))


@pytest.mark.parametrize('spec', SPECS, ids=lambda spec: spec.__name__)
def test_every_key_of_a_scene_stands_in_the_reference(spec: type[schema.Spec]) -> None:
    assert set(spec.model_fields) <= set(re.findall('`(.*?)`', TEXTS['scenes.md']))


def test_every_parameter_of_the_node_stands_in_the_reference_with_its_default() -> None:
    file = yaml.safe_load((ROOT / 'msg_config/default.yaml').read_text(encoding='utf-8'))
    defaults = {name: value for name, value in file['/**']['ros__parameters'].items()
                if name != 'qos'}
    shown = {}
    for names, values in re.findall(r'^\| (`\w+`(?:, `\w+`)*) \| (.*?) \| x? ?\|',
                                    TEXTS['node.md'], re.MULTILINE):
        pairs = [values] if '[' in values else values.split(', ')
        shown |= dict(zip(re.findall(r'\w+', names), map(yaml.safe_load, pairs), strict=True))
    assert shown == defaults


@pytest.mark.parametrize(('page', 'link'), LINKS, ids=[' '.join(link) for link in LINKS])
def test_a_link_leads_somewhere(page: str, link: str) -> None:
    path, _, anchor = link.partition('#')
    folder = ROOT if page == 'README.md' else ROOT / 'docs'
    target = folder / path if path else folder / page
    assert target.exists()
    assert not anchor or anchor in anchors(target)
