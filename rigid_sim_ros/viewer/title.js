// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0
//
// The title of the page: what the program that serves it has put into a hidden element.
'use strict';
setInterval(() => {
  const title = document.querySelector('[data-rigid-sim-title]')?.dataset.rigidSimTitle;
  if (title && document.title !== title) document.title = title;
}, 300);    // ms
