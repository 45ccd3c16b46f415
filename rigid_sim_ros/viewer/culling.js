// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0
//
// Before each drawing of bodies that can be dragged, for the picture and for each shadow map, viser
// (1.1.1) puts a function of its own before `setFromProjectionMatrix` of the tree that finds the
// visible ones. Afterwards it puts back `bind` of the one before, which stays as an own function of
// the object: the next drawing binds that, and so on. The chain grows by 24 bytes with each drawing,
// is never let go, and each drawing runs through all of it. Here the own function is taken away, so
// that the one of the class shows again.
'use strict';
(() => {
  const PERIOD = 250;     // ms between two looks for the first such tree; all share one class

  function firstTree(scene) {
    let found = null;
    scene.traverse((object) => { found ??= object.bvh ?? null; });
    return found;
  }

  function mend(tree) {
    const known = '_disableReversedDepthFrustum' in tree && 'setFromProjectionMatrix' in
        Object.getPrototypeOf(tree.bvh.frustum);
    if (!known) return;     // another version of viser
    Object.getPrototypeOf(tree)._disableReversedDepthFrustum = function disable() {
      delete this.bvh.frustum.setFromProjectionMatrix;
      this._origSetFromProjectionMatrix = null;
    };
  }

  const timer = window.setInterval(() => {
    const scene = window.__viserMutable?.scene;
    const tree = scene ? firstTree(scene) : null;
    if (!tree) return;
    window.clearInterval(timer);
    mend(tree);
  }, PERIOD);
})();
