# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""A model becomes the file of a scene."""

import os
from pathlib import Path

import click

from rigid_sim_ros.problems import printable
from rigid_sim_ros.scene import read_scene
from rigid_sim_ros.scene.build import as_written


def convert_model(model: str, output: str) -> None:
    """
    Write a model, or a scene with models, as a scene of bodies and joints; `-`: to the terminal.

    What the reader of the model has to tell goes to stderr. Raises SceneError for what is wrong
    with the model, click.ClickException for a file that exists or cannot be written.
    """
    if output != '-' and os.path.lexists(output):
        raise click.ClickException(f'{output} exists already: choose another --output, or remove '
                                   'it')
    scene = read_scene(model)
    text = f'# From {printable(os.path.basename(model))}\n{as_written(scene.spec)}'
    for note in scene.notes:
        click.echo(f'note: {note}', err=True)
    if output == '-':
        click.echo(text, nl=False)
        return
    try:
        Path(output).write_text(text, encoding='utf-8')
    except OSError as error:
        raise click.ClickException(f'{output}: {error.strerror}') from None
