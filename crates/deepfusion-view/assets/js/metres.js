// What a frame's metres are worth, in words.

/** Value, state and rank of the fact "Metres"; null where the sidecar says nothing. `meta` is a frame as the server gives it. */
export function metresTold(meta) {
  const scale = meta?.scale;
  if (meta?.camera_known === false) return ['camera not known', 'warn'];
  if (scale?.verdict === 'wrong') return [`wrong${factor(scale)}`, 'bad'];
  if (scale?.verdict === 'trusted') return [`trusted${factor(scale)}`, 'good', 'less'];
  if (scale?.verdict === 'open') return [Number.isFinite(scale.bias) ? `open${factor(scale)}` : 'not measured', '', 'less'];
  // From versions that recorded no more than whether the camera was known.
  if (meta?.scale_trusted === false) return ['not to be trusted', 'warn'];
  return null;
}

/** How many times too far things were seen when the network was measured. */
const factor = scale => Number.isFinite(scale.bias) ? ` (× ${Math.exp(scale.bias).toFixed(3)})` : '';
