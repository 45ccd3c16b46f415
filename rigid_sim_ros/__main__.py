# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
from rigid_sim_ros.programs import rigid_sim

if __name__ == '__main__':
    rigid_sim()
