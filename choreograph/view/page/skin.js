// Linear blend skinning, on the CPU and not in the shader. A few thousand vertices take a quarter of a millisecond.
// Both body and shadow are drawn from them, and in software rendering it is far less work.

export class Skin {
  constructor(mesh) {
    this.mesh = mesh;
    const count = mesh.weights.length;
    this.places = new Float32Array(3 * count);
    this.normals = new Float32Array(3 * count); // of about unit length
  }

  // matrices: three rows of four a joint.
  pose(matrices) {
    const { places, normals, joints, weights } = this.mesh;
    for (let v = 0; v < weights.length; v++) {
      const first = 12 * joints[2 * v], second = 12 * joints[2 * v + 1];
      const w = weights[v] / 255, u = 1 - w;
      const i = 3 * v;
      const x = places[i], y = places[i + 1], z = places[i + 2];
      const nx = normals[i], ny = normals[i + 1], nz = normals[i + 2];
      for (let k = 0; k < 3; k++) {
        const a = first + 4 * k, b = second + 4 * k;
        const m0 = w * matrices[a] + u * matrices[b];
        const m1 = w * matrices[a + 1] + u * matrices[b + 1];
        const m2 = w * matrices[a + 2] + u * matrices[b + 2];
        this.places[i + k] = m0 * x + m1 * y + m2 * z + w * matrices[a + 3] + u * matrices[b + 3];
        this.normals[i + k] = (m0 * nx + m1 * ny + m2 * nz) / 127;
      }
    }
  }
}
