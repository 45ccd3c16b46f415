# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of docs/architecture.md says where each formula of the lectures is; it is there."""
import ast
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[1]
TEXT = (ROOT / 'docs' / 'architecture.md').read_text(encoding='utf-8')
TABLE = TEXT.partition('| formula |')[2].partition('\n\n')[0]
ROWS = [[cell.strip() for cell in line.strip('|').split('|')]
        for line in TABLE.splitlines()[2:]]


def defined_in(path: Path) -> set[str]:
    """Return the names that the top level of a module defines."""
    found: set[str] = set()
    for node in ast.parse(path.read_text(encoding='utf-8')).body:
        if isinstance(node, (ast.FunctionDef, ast.ClassDef)):
            found.add(node.name)
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name):
            found.add(node.target.id)
    return found


def test_the_table_has_the_formulas_of_the_lectures() -> None:
    assert len(ROWS) >= 25


@pytest.mark.parametrize(('formula', 'file', 'names'), ROWS, ids=[row[0] for row in ROWS])
def test_a_formula_is_where_the_table_says(formula: str, file: str, names: str) -> None:
    path = ROOT / 'rigid_sim_ros' / 'engine' / file.strip('`')
    assert set(re.findall(r'`(\w+)`', names)) <= defined_in(path)


def test_every_file_that_the_page_names_is_there() -> None:
    known = {path.name for path in ROOT.rglob('*.py') if '.venv' not in path.parts}
    named = set(re.findall(r'`(?:[\w/]+/)?(\w+\.py)`', TEXT))
    assert named - known == set()
