// A small floor plan: where the dancer goes, seen from above, with the audience below.

const MARGIN_PX = 10, SMALLEST_M = 3;

export class FloorPlan {
  constructor() {
    this.canvas = document.getElementById("floor-plan");
    this.path = new Float32Array(0); // x, z in metres, ten a second
  }

  show(path) { this.path = path; this.draw(0); }

  draw(timeS) {
    const { canvas, path } = this, width = canvas.clientWidth, height = canvas.clientHeight;
    if (!width || !path.length) return;
    const ratio = devicePixelRatio || 1;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const style = getComputedStyle(document.documentElement), ink = (name) => style.getPropertyValue(name);
    const xs = path.filter((_, i) => i % 2 === 0), zs = path.filter((_, i) => i % 2 === 1);
    const [left, right, back, front] = [Math.min(...xs), Math.max(...xs), Math.min(...zs), Math.max(...zs)];
    const scale = Math.min((width - 2 * MARGIN_PX) / Math.max(SMALLEST_M, right - left), (height - 2 * MARGIN_PX - 12) / Math.max(SMALLEST_M, front - back));
    const x = (i) => width / 2 + (xs[i] - (left + right) / 2) * scale, y = (i) => (height - 12) / 2 + (zs[i] - (back + front) / 2) * scale;
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    context.strokeStyle = ink("--wave-core");
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    context.beginPath();
    for (let i = 0; i < xs.length; i++) context.lineTo(x(i), y(i));
    context.stroke();
    const here = Math.min(xs.length - 1, Math.round(timeS * 10));
    context.fillStyle = ink("--accent");
    context.beginPath();
    context.arc(x(here), y(here), 5, 0, 2 * Math.PI);
    context.fill();
    context.fillStyle = ink("--soft");
    context.font = "10.5px system-ui, sans-serif";
    const text = `audience · ${(right - left).toFixed(1)} × ${(front - back).toFixed(1)} m`;
    context.fillText(text, (width - context.measureText(text).width) / 2, height - 4);
  }
}
