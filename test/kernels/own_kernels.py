# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""Kernels that a test writes itself."""

from rigid_sim_ros.kernels import kernel as kernels


def of_the_engine(decorate=kernels.kernel, module=kernels):
    """
    Let a function of a test be compiled and cached as one of a module of the package.

    It is compiled anew when that module changes, or one that the module imports.
    """
    def decorated(function):
        function.__module__ = module.__name__
        return decorate(function)
    return decorated
