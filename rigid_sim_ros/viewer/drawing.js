// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0
//
// Without a graphics card the processor draws, and smooth edges take it as long as all the rest:
// there they are left out, unless the address says ?antialias.
'use strict';
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;
  const getContext = HTMLCanvasElement.prototype.getContext;

  function drawsWithProcessor() {
    const gl = document.createElement('canvas').getContext('webgl2');
    if (!gl) return false;
    const info = gl.getExtension('WEBGL_debug_renderer_info');
    const name = gl.getParameter(info ? info.UNMASKED_RENDERER_WEBGL : gl.RENDERER);
    gl.getExtension('WEBGL_lose_context')?.loseContext();
    return SOFTWARE.test(name);
  }

  if (new URLSearchParams(window.location.search).has('antialias') || !drawsWithProcessor()) return;
  HTMLCanvasElement.prototype.getContext = function get(kind, options) {
    const isPicture = kind.startsWith('webgl');
    return getContext.call(this, kind, isPicture ? {...options, antialias: false} : options);
  };
})();
