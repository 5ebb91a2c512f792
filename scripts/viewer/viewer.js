// The parts of three.js and Spark that the report's page needs, as one global: `Splats`.
export {
  Color, DataTexture, DoubleSide, GridHelper, Group, LinearFilter, Mesh, MeshBasicMaterial, PerspectiveCamera, PlaneGeometry, Quaternion,
  Raycaster, Scene, Vector2, Vector3, WebGLRenderer,
} from "three";
export { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";
export { SparkRenderer, SplatMesh } from "@sparkjsdev/spark";
