// Quaternions are stored in flat arrays as w, x, y, z. Matrices are 4 x 4, column-major, as in WebGL.

export function multiplyInto(out, o, a, i, b, j) {
  const aw = a[i], ax = a[i + 1], ay = a[i + 2], az = a[i + 3];
  const bw = b[j], bx = b[j + 1], by = b[j + 2], bz = b[j + 3];
  out[o] = aw * bw - ax * bx - ay * by - az * bz;
  out[o + 1] = aw * bx + ax * bw + ay * bz - az * by;
  out[o + 2] = aw * by - ax * bz + ay * bw + az * bx;
  out[o + 3] = aw * bz + ax * by - ay * bx + az * bw;
}

// Slerp from a[i] to b[j] by the fraction f, along the shorter arc.
export function slerpInto(out, o, a, i, b, j, f) {
  let dot = a[i] * b[j] + a[i + 1] * b[j + 1] + a[i + 2] * b[j + 2] + a[i + 3] * b[j + 3];
  const sign = dot < 0 ? -1 : 1;
  dot = Math.min(1, dot * sign);
  const angle = Math.acos(dot);
  const sine = Math.sin(angle);
  // Below a milliradian, chord and arc agree to within rounding.
  const p = sine < 1e-3 ? 1 - f : Math.sin((1 - f) * angle) / sine;
  const q = sign * (sine < 1e-3 ? f : Math.sin(f * angle) / sine);
  for (let k = 0; k < 4; k++) out[o + k] = p * a[i + k] + q * b[j + k];
}

export function rotationVectorInto(out, o, x, y, z) {
  const angle = Math.sqrt(x * x + y * y + z * z); // Math.hypot is several times slower
  const s = angle < 1e-8 ? 0.5 : Math.sin(angle / 2) / angle;
  out[o] = Math.cos(angle / 2);
  out[o + 1] = x * s;
  out[o + 2] = y * s;
  out[o + 3] = z * s;
}

// Rows of the rotation matrix of q[i], nine numbers.
export function matrixInto(out, q, i) {
  const w = q[i], x = q[i + 1], y = q[i + 2], z = q[i + 3];
  out[0] = 1 - 2 * (y * y + z * z); out[1] = 2 * (x * y - w * z); out[2] = 2 * (x * z + w * y);
  out[3] = 2 * (x * y + w * z); out[4] = 1 - 2 * (x * x + z * z); out[5] = 2 * (y * z - w * x);
  out[6] = 2 * (x * z - w * y); out[7] = 2 * (y * z + w * x); out[8] = 1 - 2 * (x * x + y * y);
}

export function perspective(fovY, aspect, near, far) {
  const f = 1 / Math.tan(fovY / 2);
  const d = 1 / (near - far);
  return [f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) * d, -1, 0, 0, 2 * far * near * d, 0];
}

export function lookAt(eye, at) {
  const z = normalized([eye[0] - at[0], eye[1] - at[1], eye[2] - at[2]]);
  const x = normalized([z[2], 0, -z[0]]);
  const y = [z[1] * x[2] - z[2] * x[1], z[2] * x[0] - z[0] * x[2], z[0] * x[1] - z[1] * x[0]];
  const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
  return [x[0], y[0], z[0], 0, x[1], y[1], z[1], 0, x[2], y[2], z[2], 0, dot(x), dot(y), dot(z), 1];
}

export function multiplyMatrices(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++)
      for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

export function normalized(v) {
  const length = Math.hypot(...v) || 1;
  return v.map((x) => x / length);
}

export const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
