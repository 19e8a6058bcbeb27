// Metres under the pointer.

const element = document.getElementById('tip');

/** Shows the depth under the pointer, of both runs if there are two. */
export function tip(app) {
  const { pointer } = app, first = pointer && app.pixelUnderPointer(pointer.run);
  element.hidden = !first;
  if (!first) return;
  const metres = app.metresUnderPointer(pointer.run), point = app.pointerPoint(pointer.run);
  const lines = [`<b data-metres="${metres}">${metres > 0 ? `${metres.toFixed(2)} m` : 'no depth'}</b>`];
  const sigma = metres > 0 ? app.shown(pointer.run)?.sigma?.at(first.x, first.y) : 0;
  if (sigma > 0) lines.push(`<span data-sigma="${sigma}">± ${sigma.toFixed(2)} m</span><br>`);
  app.runs.forEach((_, r) => {
    if (r === pointer.run) return;
    const other = app.metresUnderPointer(r);
    if (!(other > 0)) return;
    const change = metres > 0 ? ` (${other >= metres ? '+' : '−'}${Math.abs(100 * (other / metres - 1)).toFixed(1)} %)` : '';
    lines.push(`<span class="versus">${'AB'[r]}: ${other.toFixed(2)} m${change}</span><br>`);
  });
  lines.push(`pixel ${first.x}, ${first.y}`);
  if (point) lines.push(`<br>x ${point[0].toFixed(2)}  y ${point[1].toFixed(2)}  z ${point[2].toFixed(2)} m`);
  element.innerHTML = lines.join('');
  // Beside the pointer, above a finger, never outside.
  const { offsetWidth: width, offsetHeight: height } = element;
  const left = pointer.touch ? pointer.x - width / 2 : pointer.x + 16;
  const top = pointer.touch ? pointer.y - height - 44 : pointer.y + 18;
  const inX = left + width > innerWidth - 4 && !pointer.touch ? pointer.x - width - 14 : left;
  const inY = top + height > innerHeight - 4 ? pointer.y - height - 14 : top;
  element.style.transform = `translate(${Math.max(4, Math.min(innerWidth - width - 4, inX))}px, ${Math.max(4, inY)}px)`;
}
