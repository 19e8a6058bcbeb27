// Requests to the server.

/** An error that the server reports, with its hint. */
export class Problem extends Error {
  constructor(message, hint, status) {
    super(message);
    this.hint = hint;
    this.status = status;
  }
}

async function get(path) {
  const answer = await fetch(path);
  if (answer.ok) return answer;
  let body = {};
  try { body = await answer.json(); } catch { /* not this server's JSON */ }
  throw new Problem(body.error ?? `${answer.status} ${answer.statusText}`, body.hint, answer.status);
}

const of = (run, ...parts) => `/api/runs/${run}/${parts.map(encodeURIComponent).join('/')}`;

export const session = async () => (await get('/api/session')).json();
export const index = async (run, known) => (await get(`${of(run, 'index')}?known=${known}`)).json();
export const frame = async (run, name) => (await get(of(run, 'frame', name))).json();
export const depth = async (run, name) => (await get(of(run, 'depth', name))).arrayBuffer();
export const sigma = async (run, name) => (await get(of(run, 'sigma', name))).arrayBuffer();
export const image = async (run, name) => (await get(of(run, 'image', name))).blob();
export const tracks = async (run, from, count) => (await get(`${of(run, 'tracks')}?from=${from}&count=${count}`)).json();
export const training = async run => (await get(of(run, 'training'))).json();
export const panelPath = (run, name) => of(run, 'panel', name);
