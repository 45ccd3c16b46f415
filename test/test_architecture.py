# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""The table of docs/architecture.md says where each formula is; it is there, and nowhere else."""
import ast
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
import re

import pytest

ROOT = Path(__file__).parents[1]
ENGINE = ROOT / 'rigid_sim_ros' / 'engine'
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


def test_the_table_has_each_formula_once() -> None:
    formulas = [row[0] for row in ROWS]
    assert len(formulas) == len(set(formulas)) == 45
    homes = [(file, name) for _, file, names in ROWS for name in re.findall(r'`(\w+)`', names)]
    assert len(homes) == len(set(homes))


@pytest.mark.parametrize(('formula', 'file', 'names'), ROWS, ids=[row[0] for row in ROWS])
def test_a_formula_is_where_the_table_says(formula: str, file: str, names: str) -> None:
    named = re.findall(r'`(\w+)`', names)
    assert named
    assert ', '.join(f'`{name}`' for name in named) == names
    assert set(named) <= defined_in(ENGINE / file.strip('`'))


# --- formulas that are written down once --------------------------------------------------------


def called(node: ast.AST) -> str:
    """Return the name of the function that a call calls, without that of its module."""
    function = node.func if isinstance(node, ast.Call) else None
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ''


def terms_of(node: ast.expr) -> list[ast.expr]:
    """Return the terms of a sum."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add | ast.Sub):
        return terms_of(node.left) + terms_of(node.right)
    return [node]


def factors_of(node: ast.expr) -> list[ast.expr]:
    """Return the factors of a product."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Mult):
        return factors_of(node.left) + factors_of(node.right)
    return [node]


def whole(node: ast.expr) -> str:
    """Return what an expression takes elements of."""
    while isinstance(node, ast.Subscript):
        node = node.value
    return ast.dump(node)


def is_product_of_quaternions(node: ast.AST) -> bool:
    """Return whether an expression is four sums of four products, or such a vector and number."""
    if isinstance(node, ast.Tuple | ast.List):
        return len(node.elts) == 4 and all(
            [len(factors_of(term)) for term in terms_of(part)] == [2] * 4 for part in node.elts)
    # a_w b + b_w a + a x b, or v + w t + u x t of a rotation
    return (isinstance(node, ast.BinOp) and called(node.right) == 'cross'
            and len(terms_of(node)) == 3 and len(factors_of(terms_of(node)[1])) == 2)


def is_turned_tensor(node: ast.AST) -> bool:
    """Return whether an expression is R I R^T, in any way of writing."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.MatMult):
        return (isinstance(node.right, ast.Attribute) and node.right.attr == 'T'
                and isinstance(node.left, ast.BinOp) and isinstance(node.left.op, ast.MatMult)
                and ast.dump(node.right.value) == ast.dump(node.left.left))
    if isinstance(node, ast.BinOp):
        R, _, S = ([*factors_of(node), node, node])[:3]
        return len(factors_of(node)) == 3 and isinstance(S, ast.Subscript) and isinstance(
            S.value, ast.Subscript) and whole(R) == whole(S)
    if isinstance(node, ast.Call) and called(node) == 'einsum' and len(node.args) == 4:
        rule = node.args[0].value if isinstance(node.args[0], ast.Constant) else ''
        parts, _, result = str(rule).partition('->')
        summed = [part[-1] not in result for part in parts.split(',')]
        return ast.dump(node.args[1]) == ast.dump(node.args[3]) and summed[0] and summed[-1]
    if isinstance(node, ast.Call) and called(node) == 'dot' and len(node.args) == 2:
        scaled, R = node.args
        return (isinstance(R, ast.Subscript) and isinstance(scaled, ast.Call)
                and called(scaled) == 'times' and whole(scaled.args[0]) == whole(R))
    return False


def is_velocity_of_a_point(node: ast.AST) -> bool:
    """Return whether an expression adds w x r, of an angular velocity called w, to something."""
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Add):
        return is_turning(node.right)
    return (isinstance(node, ast.Call) and called(node) == 'add' and len(node.args) == 2
            and is_turning(node.args[1]))


def is_turning(node: ast.AST) -> bool:
    """Return whether an expression is w x r, of an angular velocity called w."""
    return (isinstance(node, ast.Call) and called(node) == 'cross'
            and re.fullmatch(r'w(_[A-Z]+)?', ast.unparse(node.args[0])) is not None)


def is_relative_velocity(node: ast.AST) -> bool:
    """Return whether an expression takes w_A x r_A off w_B x r_B, also element by element."""
    if isinstance(node, ast.Call) and called(node) == 'subtract':
        return is_turning(node.args[1]) and any(map(is_turning, ast.walk(node.args[0])))
    if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Sub):
        return is_turning(node.right) and any(map(is_turning, ast.walk(node.left)))
    # v_B[k] - v_A[k] + at_B[k] - at_A[k]
    return isinstance(node, ast.Tuple) and len(node.elts) == 3 and all(
        re.fullmatch(r'(\w+)\[.+\] - \1\[.+\] \+ \w+\[.+\] - \w+\[.+\]', ast.unparse(part))
        for part in node.elts)


@cache
def modules() -> list[tuple[str, ast.Module]]:
    """Return all modules of the package, by their paths in it."""
    root = ROOT / 'rigid_sim_ros'
    return [(str(path.relative_to(root)), ast.parse(path.read_text(encoding='utf-8')))
            for path in sorted(root.rglob('*.py'))]


def homes_of(is_formula: Callable[[ast.AST], bool]) -> Iterator[str]:
    """Return the modules in which a formula is written."""
    for path, tree in modules():
        if any(map(is_formula, ast.walk(tree))):
            yield path


def test_the_product_of_quaternions_is_written_once() -> None:
    assert list(homes_of(is_product_of_quaternions)) == ['engine/maths/rotation.py']


def test_inertia_is_turned_in_no_further_place() -> None:
    # The home, world_inertia.py, has it by rows, which no pattern finds. The others turn tensors
    # that are not diagonal.
    assert list(homes_of(is_turned_tensor)) == ['engine/model/inertia.py', 'models/poses.py']


def test_the_velocity_of_a_point_is_written_in_no_further_place() -> None:
    # rates.velocity_at is the home. The acceleration of a point has that form as well
    # (model_dynamics), and contact_sweep adds vectors of eight lanes.
    assert list(homes_of(is_velocity_of_a_point)) == [
        'engine/contact/contact_ahead.py', 'engine/joints/joint_coordinates.py',
        'engine/joints/loops.py', 'engine/joints/model_dynamics.py',
        'engine/solver/contact_sweep.py', 'engine/state/rates.py']


def test_the_velocity_of_one_body_against_another_is_written_in_no_further_place() -> None:
    # rates.relative_velocity is the home. contact_prediction adds the turning of both before the
    # rest, which rounds otherwise, and contact_sweep adds vectors of eight lanes.
    assert list(homes_of(is_relative_velocity)) == [
        'engine/constraints/contact_prediction.py', 'engine/solver/contact_sweep.py',
        'engine/state/rates.py']


@pytest.mark.parametrize('text', [
    'subtract(add(v, cross(w_B, b)), cross(w_A, a))', 'v + cross(w_B, b) - cross(w_A, a)',
    '(v[b, 0] - v[a, 0] + B[0] - A[0], v[b, 1] - v[a, 1] + B[1] - A[1],'
    ' v[b, 2] - v[a, 2] + B[2] - A[2])'])
def test_a_relative_velocity_is_found(text: str) -> None:
    assert any(map(is_relative_velocity, ast.walk(ast.parse(text))))


@pytest.mark.parametrize('text', [
    '(a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1],) * 1', 'v + np.cross(u, t)'])
def test_what_is_less_than_a_product_of_quaternions_is_none(text: str) -> None:
    assert not any(map(is_product_of_quaternions, ast.walk(ast.parse(text))))


@pytest.mark.parametrize('text', [
    'a[..., 3:] * b[..., :3] + b[..., 3:] * a[..., :3] + np.cross(a[..., :3], b[..., :3])',
    'v + q[3] * t + np.cross(q[:3], t)'])
def test_a_product_of_quaternions_is_found(text: str) -> None:
    assert any(map(is_product_of_quaternions, ast.walk(ast.parse(text))))


@pytest.mark.parametrize('text', [
    'R @ np.diag(I) @ R.T', "np.einsum('lab,bl,lcb->lac', R, I, R)",
    'R[k][0] * d[0] * R[j][0]', 'dot(times(R[k], d), R[j])'])
def test_a_turned_tensor_is_found(text: str) -> None:
    assert any(map(is_turned_tensor, ast.walk(ast.parse(text))))


def test_every_file_that_the_page_names_is_there() -> None:
    known = {path.name for path in ROOT.rglob('*.py') if '.venv' not in path.parts}
    named = set(re.findall(r'`(?:[\w/]+/)?(\w+\.py)`', TEXT))
    assert named - known == set()
