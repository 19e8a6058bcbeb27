// Describes how far the scale of a frame's depth can be trusted.

/** Value, state and importance of the fact "Metres"; null if the sidecar has no such field. `meta` is a frame as the server sends it. */
export function metresFact(meta) {
  const scale = meta?.scale;
  if (meta?.camera_known === false) return ['camera unknown', 'warn'];
  if (scale?.verdict === 'wrong') return [`wrong${factor(scale)}`, 'bad'];
  if (scale?.verdict === 'trusted') return [`trusted${factor(scale)}`, 'good', 'less'];
  if (scale?.verdict === 'open') return [`not verified${factor(scale)}`, '', 'less'];
  // From older versions, which recorded only whether the camera was known.
  if (meta?.scale_trusted === false) return ['not trusted', 'warn'];
  return null;
}

/** The scale factor by which the network's depth was too large when it was evaluated. */
const factor = scale => Number.isFinite(scale.bias) ? ` (× ${Math.exp(scale.bias).toFixed(3)})` : '';
