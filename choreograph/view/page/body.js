// The body of a dancer for WebGL: its mesh, skinned again in each frame, and one of less detail.

import { Skin } from "./skin.js";
import { attribute } from "./webgl.js";

const CELL_M = 0.05; // vertices in such a cube that face one way become one in a mesh of less detail
const FACING = 100; // of 127: a smaller part of a normal faces no way

export class Body {
  // apart: of which vertices one is enough for a shadow, which is blurred.
  constructor(mesh, apart) { Object.assign(this, { mesh, apart, skin: new Skin(mesh) }); }

  upload(gl) {
    const { mesh, skin } = this;
    this.surface = gl.createVertexArray();
    gl.bindVertexArray(this.surface);
    this.buffers = {
      places: attribute(gl, "aPlace", skin.places, 3, gl.FLOAT),
      normals: attribute(gl, "aNormal", skin.normals, 3, gl.FLOAT),
    };
    attribute(gl, "aColour", mesh.colours, 3, gl.UNSIGNED_BYTE);
    this.points = gl.createVertexArray();
    gl.bindVertexArray(this.points);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers.places);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12 * this.apart, 0);
    gl.bindVertexArray(this.surface);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.indices, gl.STATIC_DRAW);
  }

  // matrices: three rows of four a joint.
  pose(gl, matrices) {
    const { skin, buffers } = this;
    skin.pose(matrices);
    for (const name of ["places", "normals"]) {
      gl.bindBuffer(gl.ARRAY_BUFFER, buffers[name]);
      gl.bufferSubData(gl.ARRAY_BUFFER, 0, skin[name]);
    }
  }

  draw(gl) {
    gl.bindVertexArray(this.surface);
    gl.drawElements(gl.TRIANGLES, this.mesh.indices.length, gl.UNSIGNED_INT, 0);
  }

  // The vertices, or some of them.
  drawPoints(gl, some) {
    gl.bindVertexArray(some ? this.points : this.surface);
    gl.drawArrays(gl.POINTS, 0, Math.floor(this.mesh.weights.length / (some ? this.apart : 1)));
  }
}

// The mesh with one vertex, the outermost, of all those in a cube that face one way, move with the same joint and
// have the same colour.
export function coarseMesh({ indices, ...mesh }) {
  const { places, normals, joints, colours } = mesh, count = mesh.weights.length;
  const cells = new Map();
  const cellOf = Array.from({ length: count }, (_, v) => {
    const cube = [0, 1, 2].map((k) => Math.floor(places[3 * v + k] / CELL_M));
    const side = Array.from(normals.subarray(3 * v, 3 * v + 3), (x) => Math.round(x / FACING));
    const name = [...cube, ...side, joints[2 * v], ...colours.subarray(3 * v, 3 * v + 3)].join();
    if (!cells.has(name)) cells.set(name, { number: cells.size, side, kept: v });
    return cells.get(name);
  });
  const out = (v, { side }) => side.reduce((sum, x, k) => sum + x * places[3 * v + k], 0);
  cellOf.forEach((cell, v) => { if (out(v, cell) > out(cell.kept, cell)) cell.kept = v; });
  const kept = [...cells.values()].map((cell) => cell.kept), triangles = [];
  for (let i = 0; i < indices.length; i += 3) {
    const corners = Array.from(indices.subarray(i, i + 3), (v) => cellOf[v].number);
    if (new Set(corners).size === 3) triangles.push(...corners);
  }
  const keep = (values) => {
    const width = values.length / count;
    return values.constructor.from(kept.flatMap((v) => [...values.subarray(width * v, width * v + width)]));
  };
  const less = Object.fromEntries(Object.entries(mesh).map(([name, values]) => [name, keep(values)]));
  return { ...less, indices: Uint32Array.from(triangles) };
}
