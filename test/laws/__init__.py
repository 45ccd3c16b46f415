# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Laws of mechanics, asked of random scenes.

A package of its own name, so that benchmarks/laws.py can import it: `laws.book` lists the laws,
`laws.cases` the cases that once broke them.
"""
