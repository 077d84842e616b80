// A small floor plan: where the dancers go, seen from above, with the audience below.

const MARGIN_PX = 10, SMALLEST_M = 3;

export class FloorPlan {
  constructor() {
    this.canvas = document.getElementById("floor-plan");
    this.paths = [];
  }

  // paths: of each dancer, the first one's first: x, z in metres, ten a second.
  show(paths, timeS) {
    this.paths = paths.map((path) => [0, 1].map((k) => Array.from({ length: path.length / 2 }, (_, i) => path[2 * i + k])));
    this.line = null;
    this.draw(timeS);
  }

  draw(timeS) {
    const { canvas, paths } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !paths[0]?.[0].length) return;
    const ratio = devicePixelRatio || 1, size = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== size[0] || canvas.height !== size[1]) { [canvas.width, canvas.height] = size; this.line = null; }
    this.line ??= this.#line(width, height);
    const { lines, x, z, text } = this.line;
    const style = getComputedStyle(canvas), ink = (name) => style.getPropertyValue(name);
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    context.clearRect(0, 0, width, height);
    context.strokeStyle = ink("--wave-core");
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    for (const line of lines) context.stroke(line);
    paths.forEach(([xs, zs], i) => {
      const here = Math.min(xs.length - 1, Math.round(timeS * 10));
      context.fillStyle = ink(i ? "--soft" : "--accent");
      context.beginPath();
      context.arc(x(xs[here]), z(zs[here]), i ? 4 : 5, 0, 2 * Math.PI);
      context.fill();
    });
    context.fillStyle = ink("--soft");
    context.font = "10.5px system-ui, sans-serif";
    context.fillText(text, (width - context.measureText(text).width) / 2, height - 4);
  }

  // The paths in pixels, which are the same until the dance or the size changes.
  #line(width, height) {
    const { paths } = this, least = (k) => Math.min(...paths.map((path) => Math.min(...path[k]))), most = (k) => Math.max(...paths.map((path) => Math.max(...path[k])));
    const [left, right, back, front] = [least(0), most(0), least(1), most(1)];
    const scale = Math.min((width - 2 * MARGIN_PX) / Math.max(SMALLEST_M, right - left), (height - 2 * MARGIN_PX - 12) / Math.max(SMALLEST_M, front - back));
    const x = (m) => width / 2 + (m - (left + right) / 2) * scale, z = (m) => (height - 12) / 2 + (m - (back + front) / 2) * scale;
    const lines = paths.map(([xs, zs]) => {
      const line = new Path2D();
      for (let i = 0; i < xs.length; i++) line.lineTo(x(xs[i]), z(zs[i]));
      return line;
    });
    return { lines, x, z, text: `audience · ${(right - left).toFixed(1)} × ${(front - back).toFixed(1)} m` };
  }
}
