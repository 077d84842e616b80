// The user's character at a time: the animation of its glTF file, played by three.js.

import { GroundPath, PATH_FPS } from "./ground_path.js";
import { clamp } from "./math.js";

export class Figure {
  // joints: objects of the file in the order of the dance's names.
  constructor({ scene, animations: [clip] }, joints, dance) {
    this.scene = scene;
    this.joints = joints;
    this.pelvis = dance.names.indexOf("pelvis");
    this.positions = new Float64Array(3 * joints.length); // world, metres
    scene.traverse((object) => {
      object.castShadow = object.receiveShadow = object.isMesh === true;
      object.frustumCulled = false; // the bounds of a skin are those of one pose
      if (object.isLight) object.visible = false; // the lights of the stage are enough
    });
    this.standing = standingHeight(scene);
    this.durationS = clip.duration;
    this.mixer = new Three.AnimationMixer(scene);
    this.action = this.mixer.clipAction(clip).play();
    this.path = this.#walked();
    this.pose(0);
  }

  // The mixer's `setTime` is not used, since it returns to the start at the end of the clip.
  pose(timeS) {
    this.action.time = clamp(timeS, 0, this.durationS);
    this.mixer.update(0);
    this.scene.updateMatrixWorld(true);
    this.joints.forEach((joint, j) => this.positions.set(joint.matrixWorld.elements.slice(12, 15), 3 * j));
  }

  // Height of the standing body, metres.
  height() { return this.standing; }

  #walked() {
    const count = Math.ceil(this.durationS * PATH_FPS) + 1, roots = new Float32Array(3 * count);
    for (let i = 0; i < count; i++) {
      this.pose(i / PATH_FPS);
      roots.set(this.positions.subarray(3 * this.pelvis, 3 * this.pelvis + 3), 3 * i);
    }
    return new GroundPath(roots, count, PATH_FPS);
  }
}

// The message on the stage if the character cannot be shown.
export const NOBODY = {
  positions: new Float64Array(3),
  path: new GroundPath(new Float32Array(3), 1, PATH_FPS),
  pose() {},
  height: () => 1.7,
};

// The bounds of the skin in the file, before it dances.
function standingHeight(scene) {
  scene.updateMatrixWorld(true);
  const whole = new Three.Box3();
  scene.traverse((object) => { if (object.isSkinnedMesh) whole.union(new Three.Box3().setFromObject(object, true)); });
  return Math.max(whole.max.y - whole.min.y, 0.3);
}
