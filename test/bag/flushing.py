# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""When what was recorded has left the process."""

import threading
import time

import pytest

from rigid_sim_ros.bag.recorder import Recorder
from rigid_sim_ros.bag.writer import BagWriter

_PATIENCE = 180.0   # s: far more than it takes


def wait_until_flushed(recorder: Recorder, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wait until all that was given to a recorder is in its files."""
    end = time.monotonic() + _PATIENCE
    while recorder.status().queued_bytes:
        assert time.monotonic() < end, f'waited {_PATIENCE} s for an empty queue'
        time.sleep(0.01)
    # The writer has taken all of it: the next flush that it begins brings it out.
    flushed, flush = threading.Event(), BagWriter.flush

    def noted(writer: BagWriter) -> None:
        flush(writer)
        flushed.set()

    with monkeypatch.context() as patch:
        patch.setattr(BagWriter, 'flush', noted)
        assert flushed.wait(_PATIENCE), f'waited {_PATIENCE} s for a flush'
