# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""What `rotation.py` has for kernels, as Python runs it: for the numbers a scene is built of."""

from rigid_sim_ros.engine.maths import rotation, vector
from rigid_sim_ros.kernels.kernel import in_python

add = in_python(vector.add)
from_matrix = in_python(rotation.from_matrix)
multiply = in_python(rotation.multiply)
rotate = in_python(rotation.rotate)
to_matrix = in_python(rotation.to_matrix)
