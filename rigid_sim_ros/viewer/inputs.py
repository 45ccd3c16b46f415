# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is put into the page from here: values of inputs, and texts."""
from html import escape
from typing import Any


def put(handle: Any, value: Any) -> None:
    """Set the value of an input, if it has another; viser's types take it for read-only."""
    if handle.value != value:
        handle.value = value


def write(markdown: Any, text: str) -> None:
    """
    Set a text, if it is another; what is bold stays so.

    Names in a bag or a scene can be anything: viser would run a script that one of them holds, or
    ask another machine for a picture.
    """
    content = escape(text, quote=False).replace('[', '&#91;')
    if markdown.content != content:
        markdown.content = content
