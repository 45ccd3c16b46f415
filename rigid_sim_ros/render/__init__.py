# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Films and pictures of a bag without a display: `rigid_sim render`.

The bodies are triangles (solids.py) on a stage with light, shadow, ground and camera (stage.py,
VTK through pyvista); pictures become a film by PyAV (film.py). VTK draws 960 x 540 with shadows in
0.1 s on two cores without a GPU; ray tracers that need no system library (Mitsuba) take 4 s.
"""
