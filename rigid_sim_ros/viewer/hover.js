// Copyright 2026 The rigid_sim_ros authors
// SPDX-License-Identifier: Apache-2.0
//
// The name of the body under the mouse, beside the mouse. The program that serves the page knows
// where the bodies are and where the page looks from; it is asked while the mouse is over the
// picture, also if it rests: bodies come by.
'use strict';
(() => {
  const PERIOD = 150;     // ms between two questions
  const BESIDE = 14;      // px from the mouse to the name
  const name = document.createElement('div');
  name.id = 'hovered-body';
  Object.assign(name.style, {
    position: 'fixed', display: 'none', pointerEvents: 'none', zIndex: 1000, padding: '2px 7px',
    borderRadius: '4px', background: 'rgba(33, 37, 41, 0.88)', color: 'white',
    font: '13px system-ui, sans-serif', whiteSpace: 'nowrap',
  });
  document.body.append(name);

  let mouse = null;       // the last event over the picture
  let page = '';          // what the program calls this page
  let waiting = false;

  const isPicture = (target) => target instanceof HTMLCanvasElement && 'engine' in target.dataset;

  function show(text) {
    name.textContent = text;
    name.style.display = text && mouse ? 'block' : 'none';
    if (!text || !mouse) return;
    const fits = mouse.clientX + BESIDE + name.offsetWidth < window.innerWidth;
    name.style.left = `${mouse.clientX + (fits ? BESIDE : -BESIDE - name.offsetWidth)}px`;
    name.style.top = `${mouse.clientY + BESIDE}px`;
  }

  function follow(event) {
    // A pressed button turns the picture or drags a body.
    const over = isPicture(event.target) && event.buttons === 0 && event.pointerType !== 'touch';
    mouse = over ? event : null;
    if (!over) show('');
    else if (name.style.display === 'block') show(name.textContent);
  }

  async function ask() {
    const mark = document.querySelector('[data-rigid-sim-page]');
    page = mark ? mark.dataset.rigidSimPage : page;
    if (waiting || !mouse || !page || document.hidden) return;
    const box = mouse.target.getBoundingClientRect();
    const x = (mouse.clientX - box.left) / box.width;
    const y = (mouse.clientY - box.top) / box.height;
    waiting = true;
    try {
      const answer = await fetch(`hover?page=${page}&x=${x}&y=${y}`, {cache: 'no-store'});
      show(answer.ok ? await answer.text() : '');
    } catch {
      show('');           // the program has ended
    } finally {
      waiting = false;
    }
  }

  for (const kind of ['pointermove', 'pointerdown', 'pointerup']) {
    window.addEventListener(kind, follow, {passive: true, capture: true});
  }
  document.addEventListener('pointerleave', () => { mouse = null; show(''); });
  window.setInterval(ask, PERIOD);
})();
