// The cameras that film a dance: shots, each with the keys of a camera whose direction is fixed.

const ASPECT = 16 / 9; // of the picture that they were planned for

export class Film {
  constructor(shots) { this.shots = shots; }

  // The shot at a time.
  shot(timeS) {
    let shot = this.shots[0];
    for (const next of this.shots) if (next.start_s <= timeS) shot = next;
    return shot;
  }

  // Eye and target at a time. In a narrower picture, the camera stands farther away, so that nothing is cut off.
  at(timeS, aspect) {
    const { times_s: times, eyes, sight } = this.shot(timeS);
    let key = 0;
    while (key < times.length - 2 && times[key + 1] <= timeS) key += 1;
    const share = Math.min(1, Math.max(0, (timeS - times[key]) / (times[key + 1] - times[key])));
    const near = eyes[key].map((v, k) => v + (eyes[key + 1][k] - v) * share);
    const target = near.map((v, k) => v + sight[k]);
    const farther = Math.max(1, ASPECT / aspect);
    return { eye: target.map((v, k) => v - sight[k] * farther), target };
  }
}
