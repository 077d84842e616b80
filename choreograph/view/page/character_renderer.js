// Draws the user's character with three.js, with its own materials in the light of a room, on the mannequin's floor.

import { FOV_Y } from "./camera.js";
import { normalized } from "./math.js";
import { Resolution, openWebgl } from "./resolution.js";
import { FLOOR_FRAGMENT, GROUND_VERTEX } from "./shaders.js";
import { stageColours } from "./stage_colours.js";

const KEY_HEIGHT = 1.35; // of a light one metre to the side
const KEY_SIDE_RAD = -0.7; // from the audience
const ROOM_BLUR_RAD = 0.04;
const ROOM_STRENGTH = 0.5;
const KEY_STRENGTH = 2.2;
const RIM_STRENGTH = 2.5;
const SHADE_OPACITY = 0.55;
const REACH = 1.4; // distance within which shadows are cast, in heights of the character
const SHADOW_SIZES = { quick: 512, fine: 2048 }; // texels

export class CharacterRenderer {
  // A renderer on a canvas, or null in a browser without WebGL 2.
  static open(canvas) {
    const resolution = new Resolution(canvas), gl = openWebgl(canvas, resolution);
    return gl && new CharacterRenderer(gl, resolution);
  }

  constructor(gl, resolution) {
    const { canvas } = gl;
    Object.assign(this, { canvas, resolution });
    this.three = new Three.WebGLRenderer({ canvas, context: gl });
    this.three.toneMapping = Three.NeutralToneMapping; // keeps the colours of materials
    this.three.shadowMap.enabled = true;
    this.scene = new Three.Scene();
    this.camera = new Three.PerspectiveCamera();
    this.key = new Three.DirectionalLight("#fff3e4", KEY_STRENGTH);
    this.rimLight = new Three.DirectionalLight("white", RIM_STRENGTH);
    this.floor = floorDisc();
    this.shade = new Three.Mesh(new Three.PlaneGeometry(), new Three.ShadowMaterial({ opacity: SHADE_OPACITY }));
    this.shade.receiveShadow = true;
    this.shade.rotation.x = -Math.PI / 2;
    this.shade.renderOrder = -1; // below other transparent parts, such as hair
    Object.assign(this.shade.material, { polygonOffset: true, polygonOffsetFactor: -1, polygonOffsetUnits: -1 });
    const { key, rimLight, floor, shade } = this;
    this.scene.add(key, key.target, rimLight, rimLight.target, floor, shade);
    this.#furnish();
    canvas.addEventListener("webglcontextrestored", () => { this.#furnish(); this.draw(this.last); });
    this.readColours();
  }

  // Sets the character to draw, and a key light from the side of the audience.
  show(figure) {
    this.figure = figure;
    if (figure.scene) this.scene.add(figure.scene);
    this.light = normalized([Math.sin(KEY_SIDE_RAD), KEY_HEIGHT, Math.cos(KEY_SIDE_RAD)]);
    const reach = REACH * figure.height();
    this.shade.scale.setScalar(2 * reach);
    const { shadow } = this.key;
    Object.assign(shadow.camera, { left: -reach, right: reach, top: reach, bottom: -reach, near: 0, far: 4 * reach });
    shadow.mapSize.setScalar(this.resolution.slowMachine ? SHADOW_SIZES.quick : SHADOW_SIZES.fine);
    Object.assign(shadow, { radius: 3, bias: -0.0005, normalBias: 0.008 * figure.height() });
    this.key.castShadow = true;
  }

  // The light from all sides, without which metal is black.
  #furnish() {
    const generator = new Three.PMREMGenerator(this.three);
    this.scene.environment = generator.fromScene(new Three.RoomEnvironment(), ROOM_BLUR_RAD).texture;
    this.scene.environmentIntensity = ROOM_STRENGTH;
    generator.dispose();
  }

  readColours() {
    const { stage, floor, line, shade, exposure } = stageColours();
    this.three.setClearColor(new Three.Color().setRGB(...stage, Three.SRGBColorSpace));
    this.three.toneMappingExposure = exposure;
    const { uniforms } = this.floor.material;
    Object.entries({ uStage: stage, uFloor: floor, uLine: line }).forEach(([name, colour]) => { uniforms[name].value = colour; });
    this.shade.material.color.setRGB(...shade, Three.SRGBColorSpace);
  }

  // The colour of the light from behind, linear.
  set rim(colour) { this.rimLight.color.setRGB(...colour); }

  // Fit the drawing buffer to the element. `still` is for a picture that will not change.
  resize(still) {
    const [width, height] = this.resolution.size(still);
    if (this.canvas.width !== width || this.canvas.height !== height) this.three.setSize(width, height, false);
  }

  draw(view) {
    this.last = view;
    const { camera, canvas } = this;
    canvas.style.transform = view.mirrored ? "scaleX(-1)" : ""; // three.js would turn faces inside out
    Object.assign(camera, { fov: (FOV_Y * 180) / Math.PI, aspect: canvas.width / canvas.height, near: 0.05, far: 60 });
    camera.updateProjectionMatrix();
    camera.position.fromArray(view.eye);
    camera.lookAt(...view.target);
    camera.updateMatrixWorld();
    this.#placeLights(view);
    this.#placeFloor(view);
    this.three.render(this.scene, camera);
  }

  // The key light moves with the character, the light from behind with the camera.
  #placeLights({ eye, target }) {
    const [x, , z] = this.figure.positions, height = this.figure.height();
    this.key.target.position.set(x, height / 2, z);
    this.key.position.fromArray(this.light).multiplyScalar(2 * REACH * height).add(this.key.target.position);
    this.rimLight.target.position.fromArray(target);
    this.rimLight.position.set(2 * target[0] - eye[0], target[1] + height, 2 * target[2] - eye[2]);
    this.shade.position.set(x, 0, z);
  }

  #placeFloor({ target, floorRadius }) {
    const { uniforms } = this.floor.material;
    uniforms.uMatrix.value.multiplyMatrices(this.camera.projectionMatrix, this.camera.matrixWorldInverse);
    uniforms.uPlace.value = [target[0], target[2], floorRadius];
  }
}

// The mannequin's floor, with its own shaders in three.js.
function floorDisc() {
  const corners = [-1, -1, 1, -1, 1, 1, -1, 1];
  const geometry = new Three.BufferGeometry();
  geometry.setAttribute("aCorner", new Three.BufferAttribute(new Float32Array(corners), 2));
  geometry.setIndex([0, 1, 2, 0, 2, 3]);
  const blank = [0, 0, 0];
  const values = { uMatrix: new Three.Matrix4(), uPlace: blank, uPart: [0, 0, 1, 1], uStage: blank, uFloor: blank, uLine: blank };
  const [vertexShader, fragmentShader] = [GROUND_VERTEX, FLOOR_FRAGMENT].map((text) => text.replace("#version 300 es\n", ""));
  const disc = new Three.Mesh(geometry, new Three.RawShaderMaterial({
    glslVersion: Three.GLSL3, vertexShader, fragmentShader, side: Three.DoubleSide,
    uniforms: Object.fromEntries(Object.entries(values).map(([name, value]) => [name, { value }])),
  }));
  disc.frustumCulled = false;
  return disc;
}
