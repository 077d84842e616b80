// A small floor plan: where the dancer goes, seen from above, with the audience below.

const MARGIN_PX = 10, SMALLEST_M = 3;

export class FloorPlan {
  constructor() {
    this.canvas = document.getElementById("floor-plan");
    this.xs = this.zs = [];
  }

  // path: x, z in metres, ten a second.
  show(path, timeS) {
    const at = (k) => Array.from({ length: path.length / 2 }, (_, i) => path[2 * i + k]);
    [this.xs, this.zs] = [at(0), at(1)];
    this.line = null;
    this.draw(timeS);
  }

  draw(timeS) {
    const { canvas, xs } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !xs.length) return;
    const ratio = devicePixelRatio || 1, size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) { [canvas.width, canvas.height] = size; this.line = null; }
    this.line ??= this.#line(width, height);
    const { line, x, z, text } = this.line;
    const style = getComputedStyle(canvas), ink = (name) => style.getPropertyValue(name);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.strokeStyle = ink("--wave-core");
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.stroke(line);
    const here = Math.min(xs.length - 1, Math.round(timeS * 10));
    context.fillStyle = ink("--accent");
    context.beginPath();
    context.arc(x(here), z(here), 5, 0, 2 * Math.PI);
    context.fill();
    context.fillStyle = ink("--soft");
    context.font = "10.5px system-ui, sans-serif";
    context.fillText(text, (width - context.measureText(text).width) / 2, height - 4);
  }

  // The path in pixels, which is the same until the dance or the size changes.
  #line(width, height) {
    const { xs, zs } = this;
    const [left, right, back, front] = [Math.min(...xs), Math.max(...xs), Math.min(...zs), Math.max(...zs)];
    const scale = Math.min((width - 2 * MARGIN_PX) / Math.max(SMALLEST_M, right - left), (height - 2 * MARGIN_PX - 12) / Math.max(SMALLEST_M, front - back));
    const x = (i) => width / 2 + (xs[i] - (left + right) / 2) * scale, z = (i) => (height - 12) / 2 + (zs[i] - (back + front) / 2) * scale;
    const line = new Path2D();
    for (let i = 0; i < xs.length; i++) line.lineTo(x(i), z(i));
    return { line, x, z, text: `audience · ${(right - left).toFixed(1)} × ${(front - back).toFixed(1)} m` };
  }
}
