// Gestures of mouse, pen and fingers on a canvas, under common names.

/**
 * Calls `on.hover(x, y)`, `on.leave()`, `on.drag(dx, dy, {secondary, touch, x, y})`, `on.pinch(factor, x, y, dx, dy)`,
 * `on.wheel(delta, x, y)`, `on.tap(x, y)`, `on.double(x, y)`, with CSS pixels of the element.
 */
export function gestures(element, on) {
  const pointers = new Map();
  let moved = 0, lastTap = 0;
  const place = e => {
    const box = element.getBoundingClientRect();
    return [e.clientX - box.left, e.clientY - box.top];
  };
  const spread = () => {
    const [a, b] = [...pointers.values()];
    return { distance: Math.hypot(a[0] - b[0], a[1] - b[1]) || 1, x: (a[0] + b[0]) / 2, y: (a[1] + b[1]) / 2 };
  };
  element.addEventListener('contextmenu', e => e.preventDefault());
  element.addEventListener('pointerdown', e => {
    // Synthetic events have no pointer to capture.
    try { element.setPointerCapture(e.pointerId); } catch { /* synthetic */ }
    if (pointers.size === 0) moved = 0;
    pointers.set(e.pointerId, place(e));
    if (e.pointerType === 'touch' && pointers.size === 1) on.hover?.(...place(e), true);
  });
  element.addEventListener('pointermove', e => {
    const [x, y] = place(e), before = pointers.get(e.pointerId);
    if (!before) return on.hover?.(x, y, false);
    const [dx, dy] = [x - before[0], y - before[1]];
    if (pointers.size === 2) {
      const old = spread();
      pointers.set(e.pointerId, [x, y]);
      const now = spread();
      moved += 10;
      return on.pinch?.(now.distance / old.distance, now.x, now.y, now.x - old.x, now.y - old.y);
    }
    pointers.set(e.pointerId, [x, y]);
    moved += Math.abs(dx) + Math.abs(dy);
    if (moved > 3) on.drag?.(dx, dy, { secondary: e.shiftKey || (e.buttons & 6) !== 0, touch: e.pointerType === 'touch', x, y });
  });
  const up = e => {
    if (!pointers.delete(e.pointerId) || pointers.size > 0) return;
    if (moved > 6 || e.type === 'pointercancel') return;
    const now = performance.now();
    if (now - lastTap < 320) { lastTap = 0; on.double?.(...place(e)); } else { lastTap = now; on.tap?.(...place(e)); }
  };
  element.addEventListener('pointerup', up);
  element.addEventListener('pointercancel', up);
  element.addEventListener('pointerleave', e => { if (e.pointerType !== 'touch') on.leave?.(); });
  element.addEventListener('wheel', e => {
    e.preventDefault();
    // Converts lines and pages to pixels.
    const unit = e.deltaMode === 1 ? 16 : e.deltaMode === 2 ? 400 : 1;
    on.wheel?.(Math.max(-240, Math.min(240, e.deltaY * unit)), ...place(e));
  }, { passive: false });
}

/** Adapts a canvas to the screen's resolution. Returns whether its size changed. */
export function fit(canvas, most = 2) {
  const ratio = Math.min(devicePixelRatio || 1, most), box = canvas.getBoundingClientRect();
  const width = Math.max(1, Math.round(box.width * ratio)), height = Math.max(1, Math.round(box.height * ratio));
  canvas.ratio = ratio;
  if (canvas.width === width && canvas.height === height) return false;
  Object.assign(canvas, { width, height });
  return true;
}
