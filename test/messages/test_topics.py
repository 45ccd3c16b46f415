# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What the name of a topic tells."""

import pytest

from rigid_sim_ros.messages.topics import body_of


@pytest.mark.parametrize(('topic', 'names', 'body'), [
    ('/lab/crate/pose', ['crate', 'box'], 'crate'),
    ('/lab/arm/link/pose', ['link', 'arm/link'], 'arm/link'),
    ('/lab/arm/uplink/pose', ['link'], 'uplink'),
    ('/lab/crate/pose', [], 'crate')])
def test_a_topic_is_of_the_body_with_the_longest_name_that_fits(topic, names, body) -> None:
    assert body_of(topic, names) == body
