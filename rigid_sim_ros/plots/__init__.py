# Copyright 2026 The rigid_sim_ros authors
# SPDX-License-Identifier: Apache-2.0
"""
Diagrams of a bag: `rigid_sim plot`.

Motion in the bag, what follows from it (energies.py) and what simulating again tells (contacts.py)
become panels of lines with their units (panels.py), which are drawn as a picture (picture.py,
matplotlib) or as a page that can be zoomed into (page.py, plotly).
"""
