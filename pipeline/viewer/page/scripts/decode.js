// What Python packed (pipeline/viewer/encoding.py) as arrays that a graphics card takes.

const FORMAT = "advpipe-scene-1";
const KEPT = 0, MOVED = 1, REMOVED = 2, ADDED = 3; // the order of the points in a scene

function bytesOf(base64) {
  return Uint8Array.from(atob(base64), (letter) => letter.charCodeAt(0));
}

// Metres (3 K) of K places in little-endian 16-bit steps of unit_m.
function metresOf(base64, unit_m) {
  const bytes = bytesOf(base64);
  const steps = new DataView(bytes.buffer);
  const metres = new Float32Array(bytes.length / 2);
  for (let i = 0; i < metres.length; i++) metres[i] = steps.getInt16(2 * i, true) * unit_m;
  return metres;
}

function decodeScene(packed) {
  if (packed.format !== FORMAT) throw new Error(`not a scene of ${FORMAT}`);
  const counts = packed.points.counts;
  const actions = [KEPT, MOVED, REMOVED, ADDED].flatMap((action) => Array(counts[action]).fill(action));
  const offset = new Float32Array(3 * actions.length);
  offset.set(metresOf(packed.points.offset, packed.points.offset_unit_m), 3 * counts[KEPT]);
  return {
    ...packed,
    points: {
      ...packed.points,
      position: metresOf(packed.points.xyz, packed.points.unit_m),
      intensity: Float32Array.from(bytesOf(packed.points.intensity), (value) => value / 255),
      action: Float32Array.from(actions),
      offset,
    },
    lines: packed.lines.map((line) => ({ ...line, position: metresOf(line.xyz, line.unit_m) })),
  };
}
