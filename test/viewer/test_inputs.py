# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What is put into the page."""
from types import SimpleNamespace

from rigid_sim_ros.viewer.inputs import put, write


def test_a_name_cannot_bring_a_script_into_the_page() -> None:
    markdown = SimpleNamespace(content='')
    write(markdown, '**/tmp/<img src=x onerror=alert(1)>**')
    assert markdown.content == '**/tmp/&lt;img src=x onerror=alert(1)&gt;**'


def test_a_value_that_is_there_already_is_not_sent_again() -> None:
    class Input:
        sent = 0

        @property
        def value(self) -> float:
            return 1.0

        @value.setter
        def value(self, value: float) -> None:
            self.sent += 1

    handle = Input()
    put(handle, 1.0)
    assert handle.sent == 0
    put(handle, 2.0)
    assert handle.sent == 1


def test_a_name_cannot_make_the_page_ask_another_machine() -> None:
    markdown = SimpleNamespace(content='')
    write(markdown, '![x](http://example.org/x.png) [m/s]')
    # A bracket that is written as its number begins neither a picture nor a link.
    assert markdown.content == '!&#91;x](http://example.org/x.png) &#91;m/s]'
