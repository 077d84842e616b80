// What pages use of three.js, to be bundled: see package.json.

export {
  AnimationMixer, Box3, BufferAttribute, BufferGeometry, Color, DirectionalLight, DoubleSide,
  GLSL3, LoadingManager, Matrix4, Mesh, NeutralToneMapping, PMREMGenerator, PerspectiveCamera,
  PlaneGeometry, REVISION, RawShaderMaterial, Scene, ShadowMaterial, SRGBColorSpace, WebGLRenderer,
} from "three";
export { RoomEnvironment } from "three/addons/environments/RoomEnvironment.js";
export { GLTFLoader } from "three/addons/loaders/GLTFLoader.js";
