// A training run without predictions: its learning curve and its panels.

import * as api from './api.js';
import { css, themeColour } from './colour.js';
import { fit } from './gestures.js';
import { escape } from './picture_pane.js';

const PALETTE = ['--accent', '--warn'];

export async function showTraining(stage, runs) {
  const logs = await Promise.all(runs.map((_, i) => api.training(i)));
  const columns = [...new Set(logs.flatMap(log => log.columns))].filter(c => c !== logs[0].step_column);
  const element = document.createElement('div');
  element.className = 'training';
  element.innerHTML = `<h2>Learning curve${runs.length > 1 ? `: ${runs.map((r, i) => `${'AB'[i]} ${escape(r.name)}`).join(', ')}` : ''}</h2><div class="charts"></div>`
    + runs.map((r, i) => logs[i].panels.length ? `<h2>Panels${runs.length > 1 ? ` of ${escape(r.name)}` : ''}</h2><div class="pick"><input type="range" aria-label="Panel" min="0" max="${logs[i].panels.length - 1}" value="${logs[i].panels.length - 1}"><span></span></div><div class="panel"><img alt="Panel of a training sample"></div>` : '').join('');
  const charts = columns.map(column => {
    const chart = document.createElement('div');
    chart.className = 'chart';
    chart.innerHTML = `<h3>${escape(column.replaceAll('_', ' '))}<span></span></h3><canvas></canvas>`;
    element.querySelector('.charts').append(chart);
    return { column, canvas: chart.querySelector('canvas'), readout: chart.querySelector('span') };
  });
  stage.replaceChildren(element);
  const picks = [...element.querySelectorAll('.pick')], pictures = [...element.querySelectorAll('.panel img')];
  const withPanels = logs.map((log, i) => [log, i]).filter(([log]) => log.panels.length);
  picks.forEach((pick, i) => {
    const [log, run] = withPanels[i], input = pick.querySelector('input');
    const show = () => {
      const name = log.panels[Number(input.value)];
      pictures[i].src = api.panelPath(run, name);
      pick.querySelector('span').textContent = name;
    };
    input.oninput = show;
    show();
  });
  const draw = () => charts.forEach(chart => drawChart(chart, logs));
  addEventListener('resize', draw);
  new MutationObserver(draw).observe(document.documentElement, { attributeFilter: ['data-theme'] });
  draw();
}

function drawChart({ column, canvas, readout }, logs) {
  fit(canvas);
  const ctx = canvas.getContext('2d'), width = canvas.width / canvas.ratio, height = canvas.height / canvas.ratio;
  ctx.setTransform(canvas.ratio, 0, 0, canvas.ratio, 0, 0);
  ctx.clearRect(0, 0, width, height);
  const lines = logs.flatMap((log, i) => ['train', 'validation'].map(part => ({
    colour: PALETTE[i % 2], dots: part === 'validation',
    // A validation is not a step: its step columns are 0.
    points: (part === 'validation' && ['learning_rate', 'images_per_second'].includes(column) ? [] : log[part][column] ?? []).map((v, j) => [log[part][log.step_column][j], v]).filter(p => p[0] !== null && p[1] !== null),
  }))).filter(l => l.points.length);
  const all = lines.flatMap(l => l.points);
  if (!all.length) return;
  const xs = all.map(p => p[0]), ys = all.map(p => p[1]).sort((a, b) => a - b);
  // The first steps may be outliers: the lowest 0.5 % and the highest 1 % of the values do not stretch the chart.
  let [low, high] = [ys[Math.floor(0.005 * (ys.length - 1))], ys[Math.ceil(0.99 * (ys.length - 1))]];
  if (!(high > low)) [low, high] = [low - 0.5, high + 0.5];
  const [first, last] = [xs.reduce((a, b) => Math.min(a, b)), xs.reduce((a, b) => Math.max(a, b))];
  const x = s => 44 + (s - first) / Math.max(1, last - first) * (width - 50), y = v => 8 + (high - Math.min(high, Math.max(low, v))) / (high - low) * (height - 26);
  ctx.font = '10px system-ui, sans-serif';
  for (const v of [low, (low + high) / 2, high]) {
    ctx.fillStyle = css(themeColour('--line'));
    ctx.fillRect(44, y(v), width - 50, 0.6);
    ctx.fillStyle = css(themeColour('--dim'));
    ctx.textAlign = 'right';
    ctx.fillText(Number(v.toPrecision(3)).toString(), 40, y(v) + 3);
  }
  ctx.textAlign = 'left';
  ctx.fillText(`step ${first}`, 44, height - 4);
  ctx.textAlign = 'right';
  ctx.fillText(String(last), width - 6, height - 4);
  for (const line of lines) {
    const colour = themeColour(line.colour);
    if (line.dots) {
      ctx.fillStyle = css(themeColour('--text'));
      for (const [s, v] of line.points) { ctx.beginPath(); ctx.arc(x(s), y(v), 2.6, 0, 7); ctx.fill(); }
      continue;
    }
    const draw = (points, alpha, wide) => {
      ctx.strokeStyle = css(colour, alpha);
      ctx.lineWidth = wide;
      ctx.beginPath();
      points.forEach(([s, v], i) => i ? ctx.lineTo(x(s), y(v)) : ctx.moveTo(x(s), y(v)));
      ctx.stroke();
    };
    draw(line.points, 0.3, 1);
    draw(smooth(line.points), 1, 1.6);
  }
  readout.textContent = Number(smooth(lines[0].points).at(-1)[1].toPrecision(4)).toString();
}

/** An exponential mean over about a fiftieth of the points. */
function smooth(points) {
  const keep = Math.exp(-1 / Math.max(1, points.length / 50));
  let mean = points[0][1];
  return points.map(([s, v]) => [s, mean = keep * mean + (1 - keep) * v]);
}
