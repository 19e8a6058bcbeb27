// The keys and their actions: one table for the help and the keyboard.

/** Groups of [keys as shown, keys as in events, description, action of the app]. */
export const KEYS = [
  ['Time', [
    [['Space'], [' '], 'play, pause', app => app.player.toggle()],
    [['←'], ['ArrowLeft'], 'back (Shift: ten frames)', (app, e) => app.step(e.shiftKey ? -10 : -1)],
    [['→'], ['ArrowRight'], 'forward (Shift: ten frames)', (app, e) => app.step(e.shiftKey ? 10 : 1)],
    [['Home'], ['Home'], 'first frame', app => app.seek(0)],
    [['End'], ['End'], 'last frame', app => app.seek(app.runs[0].length - 1)],
    [['<', '>'], ['<', '>'], 'slower, faster', (app, e) => app.player.faster(e.key === '<' ? -1 : 1)],
    [['O'], ['o'], 'repeat', app => app.repeat()],
  ]],
  ['Cloud', [
    [['1'], ['1'], 'behind the vehicle', app => app.go('chase')],
    [['2'], ['2'], 'from above', app => app.go('top')],
    [['3'], ['3'], 'from the side', app => app.go('side')],
    [['4'], ['4'], 'from the camera', app => app.go('eye')],
    [['M'], ['m'], 'colour by picture, depth, height', app => app.nextMode()],
    [['E'], ['e'], 'hide points at depth edges', app => app.flip('edges')],
    [['U'], ['u'], 'fade uncertain pixels', app => app.flip('fade')],
    [['S'], ['s'], 'surface, points', app => app.flip('surface')],
    [['[', ']'], ['[', ']'], 'range of the cloud', (app, e) => app.reach(e.key === '[' ? -1 : 1)],
    [['-', '+'], ['-', '+', '='], 'size of the points', (app, e) => app.pointSize(e.key === '-' ? 1 / 1.25 : 1.25)],
  ]],
  ['View', [
    [['P'], ['p'], 'picture', app => app.pane('picture')],
    [['D'], ['d'], 'depth', app => app.pane('depth')],
    [['C'], ['c'], 'cloud', app => app.pane('cloud')],
    [['L'], ['l'], 'list of targets', app => app.pane('list')],
    [['B'], ['b'], 'boxes', app => app.flip('boxes')],
    [['T'], ['t'], 'tracks', app => app.flip('tracks')],
    [['N'], ['n'], 'labels of the boxes', app => app.flip('labels')],
    [['I'], ['i'], 'colour by track, or by motion', app => app.flip('byTrack')],
    [['G'], ['g'], 'distance rings on the ground', app => app.flip('ground')],
    [['X'], ['x'], 'two runs: depth relative to the first', app => app.flip('difference')],
  ]],
  ['Page', [
    [['R'], ['r'], 'reset views', app => app.resetViews()],
    [['Y'], ['y'], 'dark, light', app => app.nextTheme()],
    [['F'], ['f'], 'full screen', () => document.fullscreenElement ? document.exitFullscreen() : document.documentElement.requestFullscreen?.()],
    [['Esc'], ['Escape'], 'deselect the target', app => app.choose(0, null)],
    [['?'], ['?'], 'this help', app => help(app)],
  ]],
];

/** Runs a key's action. Returns whether it has one. */
export function onKey(app, e) {
  if (e.ctrlKey || e.metaKey || e.altKey) return false;
  const key = e.key.length === 1 ? e.key.toLowerCase() : e.key;
  for (const [, keys] of KEYS) for (const [, events, , act] of keys) if (events.includes(key)) { act(app, e); return true; }
  return false;
}

export function help() {
  const dialog = document.getElementById('help');
  if (dialog.open) return dialog.close();
  const groups = KEYS.map(([name, keys]) => `<section><h3>${name}</h3>${keys.map(([shown, , what]) => `<div><span>${what}</span><span>${shown.map(k => `<kbd>${k.replace('<', '&lt;')}</kbd>`).join('')}</span></div>`).join('')}</section>`);
  dialog.innerHTML = `<button class="close" aria-label="Close">✕</button><h2>Keys</h2><div class="keys">${groups.join('')}</div>`
    + '<p>Pictures: the pointer shows the depth, the wheel zooms, dragging pans, a double click resets the zoom. Cloud: dragging rotates (with Shift or the right button, pans), the wheel zooms, a double click rotates about that point. A click on a box selects its track.</p>'
    + '<p>Touch: one finger shows the depth or rotates the cloud, two zoom and pan. A double tap does what a double click does.</p>';
  dialog.querySelector('.close').onclick = () => dialog.close();
  dialog.onclick = e => { if (e.target === dialog) dialog.close(); };
  dialog.showModal();
}
