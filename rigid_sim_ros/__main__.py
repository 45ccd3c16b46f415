# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
from rigid_sim_ros.cli import main

if __name__ == '__main__':
    main()
