// Plain colour over the corners of the picture that hold nothing, left and right of the dancer above the floor.
// Where the processor draws, the browser takes a picture that changes point by point and plain colour in
// one go, and leaves out what is covered: a fifth of the stage is saved.

const EDGE_POINTS = 32;
const STEP_PX = 16; // covers change in steps, not with every breath
const LEAST_PX = 64; // a smaller one is not worth a layer

export class Covers {
  constructor(canvas) {
    this.canvas = canvas;
    this.elements = ["left", "right"].map((side) => {
      const element = document.createElement("i");
      element.className = `cover ${side}`;
      return element;
    });
    canvas.after(...this.elements);
  }

  // places: of the body's surface, three numbers each; disc: x, z and radius of the floor.
  fit({ matrix }, places, disc) {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    const top = topOf(matrix, disc);
    const [left, right] = sidesOf(matrix, places);
    const high = stepped((0.5 - 0.5 * top) * height);
    this.#show(0, stepped((0.5 + 0.5 * left) * width), high);
    this.#show(1, stepped((0.5 - 0.5 * right) * width), high);
  }

  #show(i, width, height) {
    const shown = width >= LEAST_PX && height >= LEAST_PX;
    const style = shown ? `scale(${width}, ${height})` : "scale(0)";
    if (this.elements[i].style.transform !== style) this.elements[i].style.transform = style;
  }
}

const stepped = (px) => STEP_PX * Math.floor((px - 2) / STEP_PX);

// The highest that the floor reaches on the screen, -1 to 1 from the bottom up.
function topOf(matrix, [x, z, radius]) {
  let top = -1;
  for (let i = 0; i < EDGE_POINTS; i++) {
    const angle = (2 * Math.PI * i) / EDGE_POINTS;
    const px = x + radius * Math.cos(angle), pz = z + radius * Math.sin(angle);
    const w = matrix[3] * px + matrix[11] * pz + matrix[15];
    if (w > 0) top = Math.max(top, (matrix[1] * px + matrix[9] * pz + matrix[13]) / w);
  }
  return top;
}

// From where to where the body reaches on the screen, -1 to 1; all of it where the eye is in the body.
function sidesOf(matrix, places) {
  let left = 1, right = -1;
  for (let i = 0; i < places.length; i += 3) {
    const x = places[i], y = places[i + 1], z = places[i + 2];
    const w = matrix[3] * x + matrix[7] * y + matrix[11] * z + matrix[15];
    if (w <= 0) return [-1, 1];
    const at = (matrix[0] * x + matrix[4] * y + matrix[8] * z + matrix[12]) / w;
    if (at < left) left = at;
    if (at > right) right = at;
  }
  return [left, right];
}
