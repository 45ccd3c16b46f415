# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the README shows is what happens."""
from pathlib import Path
import re
import subprocess
import sys

import pytest

from rigid_sim_ros import cli
from rigid_sim_ros.engine.dynamics.forces import FORCES
from rigid_sim_ros.scene import scene_from_text
from rigid_sim_ros.scene.advice import advice

TEXT = (Path(__file__).parent.parent / 'README.md').read_text(encoding='utf-8')
BLOCKS = re.findall(r'^```(\w+)\n(.*?)^```$', TEXT, re.MULTILINE | re.DOTALL)
PYTHON = [code for language, code in BLOCKS if language == 'python' and 'rclpy' not in code]
CONSOLE = dict(re.match(r'\$ (.*?)\n(.*)', code, re.DOTALL).groups()
               for language, code in BLOCKS if language == 'console')


def trimmed(text: str) -> list[str]:
    """Return the lines without blanks at their ends and blank lines around them."""
    return [line.rstrip() for line in text.strip('\n').splitlines() if line.strip()]


@pytest.mark.parametrize('command', ['rigid_sim scenes', 'rigid_sim check spring_pendulum'])
def test_the_output_of_a_command_is_the_one_shown(command: str, capsys) -> None:
    with pytest.raises(SystemExit):
        cli.main(command.split()[1:])
    assert trimmed(capsys.readouterr().out) == trimmed(CONSOLE[command])


@pytest.mark.parametrize('code', PYTHON, ids=range(len(PYTHON)))
def test_the_python_of_the_readme_runs(code: str) -> None:
    result = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True, check=False, timeout=300)
    assert (result.returncode, result.stderr) == (0, '')
    shown = [text for language, text in BLOCKS if language == 'text']
    assert result.stdout in ['', *shown]


def test_the_scene_of_the_readme_loads_without_a_warning() -> None:
    scene, = (text for language, text in BLOCKS if language == 'yaml')
    assert advice(scene_from_text(scene)) == []


@pytest.mark.parametrize('kind', FORCES)
def test_every_force_and_its_keys_stand_in_the_readme(kind: str) -> None:
    row, = re.findall(rf'^\| `{kind}` \|.*$', TEXT, re.MULTILINE)
    keys = {parameter.name for parameter in FORCES[kind].parameters}
    assert keys <= set(re.findall('`(.*?)`', row))


@pytest.mark.parametrize('link', re.findall(r'\]\((?!#|http)(.*?)\)', TEXT))
def test_a_link_of_the_readme_leads_somewhere(link: str) -> None:
    assert (Path(__file__).parent.parent / link).exists()
