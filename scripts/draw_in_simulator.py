#!/usr/bin/env python3
"""Loads an exported model in a simulator and draws it off screen, without a GPU.

    pip install pillow and one of: mujoco | newton newton-usd-schemas usd-core | pybullet
    scripts/draw_in_simulator.py mujoco model/scene.xml picture.png
    scripts/draw_in_simulator.py newton model/NAME/usd/NAME.usda picture.png
    scripts/draw_in_simulator.py pybullet model/NAME.urdf picture.png

MuJoCo and PyBullet first let the model fall by 2 cm onto a floor, and draw it after 2 s; Newton draws it as it stands.
"""

import argparse
import math
import os
import warnings

import numpy as np
from PIL import Image

WIDTH, HEIGHT = 960, 540
FIELD_OF_VIEW_DEG = 40.0
AZIMUTH_DEG, ELEVATION_DEG = 130.0, -20.0
RESTS_S = 2.0
FALL_M = 0.02
# From the middle of the object, in halves of the diagonal of its box.
DISTANCE = 3.2


def mujoco(path):
    os.environ.setdefault("MUJOCO_GL", "egl")
    import mujoco

    model = mujoco.MjModel.from_xml_path(path)
    model.vis.global_.offwidth, model.vis.global_.offheight = WIDTH, HEIGHT
    model.vis.global_.fovy = FIELD_OF_VIEW_DEG
    data = mujoco.MjData(model)
    data.qpos[2] += FALL_M
    while data.time < RESTS_S:
        mujoco.mj_step(model, data)
    body = int(np.argmax(model.body_mass))
    camera = mujoco.MjvCamera()
    camera.lookat, camera.azimuth, camera.elevation = data.xipos[body], AZIMUTH_DEG, ELEVATION_DEG
    geoms = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == body]
    camera.distance = DISTANCE * max(float(model.geom_rbound[geom]) for geom in geoms)
    with mujoco.Renderer(model, HEIGHT, WIDTH) as renderer:
        renderer.update_scene(data, camera)
        return renderer.render()


def newton(path):
    import newton
    import warp as wp
    from pxr import Usd

    warnings.simplefilter("ignore")  # The sensor is to be renamed.
    wp.config.quiet = True
    builder = newton.ModelBuilder()
    builder.add_usd(Usd.Stage.Open(path))
    corners = []
    for kind, mesh, at in zip(builder.shape_type, builder.shape_source, builder.shape_transform):
        if int(kind) == int(newton.GeoType.MESH):
            turn = np.array(wp.quat_to_matrix(wp.quat(*at[3:]))).reshape(3, 3)
            corners.append(np.asarray(mesh.vertices) @ turn.T + np.array(at[:3]))
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    builder.add_ground_plane(height=float(low[2]))
    model = builder.finalize(device="cpu")
    state = model.state()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    sensor = newton.sensors.SensorTiledCamera(model)
    sensor.default_render_config.enable_textures = sensor.default_render_config.enable_shadows = True
    sensor.utils.create_default_light()
    rays = sensor.utils.compute_camera_rays_pinhole(WIDTH, HEIGHT, camera_fovs=math.radians(FIELD_OF_VIEW_DEG))
    picture = sensor.utils.create_color_image_output(WIDTH, HEIGHT)
    middle, half = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    azimuth, elevation = math.radians(AZIMUTH_DEG), math.radians(ELEVATION_DEG)
    forward = np.array([math.cos(elevation) * math.cos(azimuth), math.cos(elevation) * math.sin(azimuth), math.sin(elevation)])
    right = np.cross(forward, [0, 0, 1]) / np.linalg.norm(np.cross(forward, [0, 0, 1]))
    turn = np.stack([right, np.cross(right, forward), -forward], axis=1)
    eye = middle - DISTANCE * half * forward
    pose = wp.transformf(wp.vec3f(*eye.tolist()), wp.quat_from_matrix(wp.mat33(*turn.flatten().tolist())))
    model.bvh_refit_shapes(state)
    sensor.update(state, wp.array([[pose]], dtype=wp.transformf, device="cpu"), rays, color_image=picture)
    packed = picture.numpy().reshape(HEIGHT, WIDTH)
    return np.stack([packed & 255, packed >> 8 & 255, packed >> 16 & 255], axis=-1).astype(np.uint8)


def pybullet(path):
    import pybullet
    import pybullet_data

    pybullet.connect(pybullet.DIRECT)
    pybullet.setGravity(0, 0, -9.8)
    pybullet.setAdditionalSearchPath(pybullet_data.getDataPath())
    pybullet.loadURDF("plane.urdf")
    body = pybullet.loadURDF(path, useFixedBase=False)

    def box():
        """The corners of the box around all links."""
        boxes = np.array([pybullet.getAABB(body, link) for link in range(-1, pybullet.getNumJoints(body))])
        return boxes[:, 0].min(axis=0), boxes[:, 1].max(axis=0)

    low, high = box()
    at, turn = pybullet.getBasePositionAndOrientation(body)
    pybullet.resetBasePositionAndOrientation(body, [at[0], at[1], at[2] + FALL_M - low[2]], turn)
    for _ in range(round(RESTS_S * 240)):
        pybullet.stepSimulation()
    middle = np.mean(box(), axis=0).tolist()
    half = float(np.linalg.norm(high - low)) / 2
    view = pybullet.computeViewMatrixFromYawPitchRoll(middle, DISTANCE * half, AZIMUTH_DEG - 90, ELEVATION_DEG, 0, 2)
    lens = pybullet.computeProjectionMatrixFOV(FIELD_OF_VIEW_DEG, WIDTH / HEIGHT, 0.01, 20)
    picture = pybullet.getCameraImage(WIDTH, HEIGHT, view, lens, renderer=pybullet.ER_TINY_RENDERER, lightDirection=[1, 1, 2])[2]
    return np.reshape(picture, (HEIGHT, WIDTH, 4))[:, :, :3].astype(np.uint8)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("simulator", choices=["mujoco", "newton", "pybullet"])
    parser.add_argument("model")
    parser.add_argument("picture")
    options = parser.parse_args()
    draw = {"mujoco": mujoco, "newton": newton, "pybullet": pybullet}[options.simulator]
    Image.fromarray(draw(options.model)).save(options.picture)


if __name__ == "__main__":
    main()
