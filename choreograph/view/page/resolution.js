// The resolution of the stage. It is lowered while frames are slow, raised again, and highest for still pictures.

const MAX_PIXEL_RATIO = 2;
const STILL_PIXEL_RATIO = 2; // where there is no other antialiasing
const SMALLEST_SCALE = 0.6;
const SLOW_FRAME_S = 1 / 48;
const PATIENCE = 90; // a slow frame adds 3, a good one subtracts 1. At this sum the resolution is lowered
const STEADY_FRAMES = 600; // good frames in a row before the resolution is raised, doubled after each attempt

export class Resolution {
  constructor(canvas) {
    this.canvas = canvas;
    this.scale = 1;
    this.slow = 0;
    this.steady = 0;
    this.steadyNeeded = STEADY_FRAMES;
    // In software rendering only still pictures are antialiased.
    this.slowMachine = rendersInSoftware();
  }

  // Width and height of the drawing buffer that fits the element. `still` is for a picture that will not change.
  size(still) {
    const fine = Math.min(devicePixelRatio || 1, MAX_PIXEL_RATIO);
    const ratio = still ? Math.max(fine, this.slowMachine ? STILL_PIXEL_RATIO : 0) : fine * this.scale;
    return [this.canvas.clientWidth, this.canvas.clientHeight].map((length) => Math.max(1, Math.round(length * ratio)));
  }

  // Report the duration of the last frame.
  reportFrameTime(elapsedS) {
    const late = elapsedS > SLOW_FRAME_S;
    this.slow = late ? this.slow + 3 : Math.max(0, this.slow - 1);
    this.steady = late ? 0 : this.steady + 1;
    if (this.slow >= PATIENCE && this.scale > SMALLEST_SCALE) {
      this.scale = Math.max(SMALLEST_SCALE, this.scale * 0.8);
    } else if (this.steady >= this.steadyNeeded && this.scale < 1) {
      this.scale = Math.min(1, this.scale / 0.8);
      this.steadyNeeded *= 2;
    } else return;
    this.slow = this.steady = 0;
  }
}

// The canvas's WebGL 2, or null.
export function openWebgl(canvas, resolution) {
  return canvas.getContext("webgl2", { alpha: false, antialias: !resolution.slowMachine });
}

// Whether there is no graphics card, or only one that the browser has blocked.
function rendersInSoftware() {
  const gl = document.createElement("canvas").getContext("webgl2");
  if (!gl) return true;
  let name = gl.getParameter(gl.RENDERER);
  if (name === "WebKit WebGL") {
    const more = gl.getExtension("WEBGL_debug_renderer_info");
    if (more) name = gl.getParameter(more.UNMASKED_RENDERER_WEBGL);
  }
  gl.getExtension("WEBGL_lose_context")?.loseContext();
  return /swiftshader|llvmpipe|softpipe|software|basic render/i.test(name);
}
