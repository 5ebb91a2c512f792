// The ground below the moving object: a grid, and the object's shadow in light from above.
"use strict";

function groundOf({ ground_z: height, sphere }, count) {
  const { DataTexture, DoubleSide, GridHelper, Group, LinearFilter, Mesh, MeshBasicMaterial, PlaneGeometry } = Splats;
  // Side of the ground in radii of the motion's sphere; squares of the grid and pixels of the shadow along a side.
  const SIDE = 3.2, SQUARES = 16, PIXELS = 128;
  // Darkening of a pixel if all Gaussians lay above it; opacity of the darkest shadow; height, in radii, from which a Gaussian casts
  // no shadow.
  const SHADE = 900, DARKEST = 0.38, HIGHEST = 1.5;
  const side = SIDE * sphere.radius, group = new Group();
  group.position.set(sphere.center[0], sphere.center[1], height);

  const plane = (material) => {
    const mesh = new Mesh(new PlaneGeometry(side, side), new MeshBasicMaterial({ transparent: true, depthWrite: false, side: DoubleSide, ...material }));
    group.add(mesh);
    return mesh;
  };
  plane({ color: 0x888888, opacity: 0.14 }).renderOrder = -3;
  const grid = new GridHelper(side, SQUARES, 0x888888, 0x888888);
  Object.assign(grid.material, { transparent: true, opacity: 0.3, depthWrite: false });
  grid.rotation.x = Math.PI / 2;
  grid.renderOrder = -2;
  group.add(grid);
  const rgba = new Uint8Array(4 * PIXELS * PIXELS), shadow = new DataTexture(rgba, PIXELS, PIXELS);
  shadow.magFilter = LinearFilter;
  plane({ map: shadow }).renderOrder = -1;

  let depth = new Float32Array(PIXELS * PIXELS), blurred = new Float32Array(PIXELS * PIXELS);
  /* Averages each pixel with its neighbours at a distance of `step`. */
  const blur = (step) => {
    for (let at = step; at < depth.length - step; at++) blurred[at] = 0.25 * depth[at - step] + 0.5 * depth[at] + 0.25 * depth[at + step];
    [depth, blurred] = [blurred, depth];
  };
  return {
    group,
    begin() { depth.fill(0); },
    /* The shadow of a Gaussian at `center`. */
    under(center, opacity) {
      const pixel = (axis) => Math.floor(((center.getComponent(axis) - sphere.center[axis]) / side + 0.5) * PIXELS);
      const x = pixel(0), y = pixel(1), above = (center.z - height) / sphere.radius;
      if (x >= 0 && x < PIXELS && y >= 0 && y < PIXELS) depth[y * PIXELS + x] += opacity * Math.max(0, 1 - above / HIGHEST);
    },
    end() {
      for (const step of [1, PIXELS, 1, PIXELS]) blur(step);
      for (let at = 0; at < depth.length; at++) rgba[4 * at + 3] = 255 * DARKEST * (1 - Math.exp((-SHADE / count) * depth[at]));
      shadow.needsUpdate = true;
    },
  };
}
