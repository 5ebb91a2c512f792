"""Loads exported models in MuJoCo and prints what it finds as JSON, for several models as a list.

mujoco_check.py load MODEL...                  mass, centre of mass, inertia of the object
mujoco_check.py rest MODEL...                  how it moves after a fall of 2 cm on a plane
mujoco_check.py table SCENE...                 mass, and how far it is moved and turned 2 s later, of each free body of a scene
mujoco_check.py whole MODEL...                 mass, centre of mass, inertia of all bodies together, their names and geoms
mujoco_check.py pads MODEL PADS                what the contacts of two pads with the object have, without and with the file PADS
mujoco_check.py contacts SCENE...              how many contacts there are before anything moves
mujoco_check.py lift MODEL GRASP.json          how far two pads raise it; GRASP: contacts_m, approach, finger_side_m, force_n
"""

import json
import os
import sys
import tempfile
import xml.etree.ElementTree as ET

import mujoco
import numpy as np

GRAVITY = 9.8


def compiled(path):
    return mujoco.MjModel.from_xml_path(path)


def object_body(model):
    return int(np.argmax(model.body_mass))


def as_mjcf(path):
    """The model, and as an MJCF tree as MuJoCo saves it, with the folder of its files."""
    model = compiled(path)
    folder = os.path.dirname(os.path.abspath(path))
    with tempfile.NamedTemporaryFile(dir=folder, suffix=".saved.xml", delete=False) as file:
        saved = file.name
    try:
        mujoco.mj_saveLastXML(saved, model)
        return model, ET.parse(saved).getroot(), folder
    finally:
        os.remove(saved)


def from_tree(tree, folder):
    with tempfile.NamedTemporaryFile(dir=folder, suffix=".test.xml", delete=False) as file:
        file.write(ET.tostring(tree))
    try:
        return compiled(file.name)
    finally:
        os.remove(file.name)


def lowest(model):
    """The least z of the vertices of the object's colliders in the world frame."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    least = np.inf
    for geom in range(model.ngeom):
        mesh = model.geom_dataid[geom]
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH or model.geom_contype[geom] == 0:
            continue
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        vertices = model.mesh_vert[first:first + count]
        turned = vertices @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        least = min(least, turned[:, 2].min())
    return float(least)


def load(path):
    model = compiled(path)
    body = object_body(model)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[body])
    turn = turn.reshape(3, 3)
    return {
        "mass_kg": float(model.body_mass[body]),
        "center_of_mass_m": model.body_ipos[body].tolist(),
        "inertia_kg_m2": (turn @ np.diag(model.body_inertia[body]) @ turn.T).tolist(),
        "free_joints": int(np.sum(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)),
        "geoms": int(model.ngeom),
        "total_mass_kg": float(np.sum(model.body_mass)),
    }


def whole(path):
    model = compiled(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    masses = model.body_mass
    center = masses @ data.xipos / masses.sum()
    inertia = np.zeros((3, 3))
    for body in range(model.nbody):
        turn, offset = data.ximat[body].reshape(3, 3), data.xipos[body] - center
        own = turn @ np.diag(model.body_inertia[body]) @ turn.T
        inertia += own + masses[body] * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return {
        "mass_kg": float(masses.sum()),
        "center_of_mass_m": center.tolist(),
        "inertia_kg_m2": inertia.tolist(),
        "bodies": [model.body(body).name for body in range(1, model.nbody)],
        "geoms": [model.geom(geom).name for geom in range(model.ngeom)],
        "free_joints": int(np.sum(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)),
        "joints": model.njnt,
    }


def pads(path, of_pads):
    """Pads with a friction of 1 that overlap the object."""
    model = compiled(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    at = " ".join(map(str, data.xipos[object_body(model)]))
    box = lambda name: f'<geom name="{name}" type="box" size="0.02 0.02 0.02" pos="{at}" friction="1 0.005 0.0001"/>'
    found = []
    for files in ([path], [path, of_pads]):
        includes = "".join(f'<include file="{os.path.basename(file)}"/>' for file in files)
        text = f'<mujoco>{includes}<worldbody>{box("left_pad")}{box("right_pad")}</worldbody></mujoco>'
        model = from_tree(ET.fromstring(text), os.path.dirname(os.path.abspath(path)))
        data = mujoco.MjData(model)
        mujoco.mj_forward(model, data)
        found.append([contact_of(model, contact) for contact in data.contact[:data.ncon]])
    return found


def contact_of(model, contact):
    names = sorted(model.geom(int(geom)).name for geom in contact.geom)
    return {"geoms": names, "friction": contact.friction.tolist(), "condim": int(contact.dim), "solref": contact.solref.tolist()}


def with_plane(path):
    model, tree, folder = as_mjcf(path)
    world = tree.find("worldbody")
    z = lowest(model)
    ET.SubElement(world, "geom", name="floor", type="plane", size="5 5 1", pos=f"0 0 {z}", friction="0.4 0.005 0.0001")
    option = tree.find("option")
    option = ET.SubElement(tree, "option") if option is None else option
    option.set("gravity", f"0 0 {-GRAVITY}")
    return tree, folder


def rest(path):
    """How far it moves from 2 s to 4 s after a fall of 2 cm."""
    tree, folder = with_plane(path)
    model = from_tree(tree, folder)
    data = mujoco.MjData(model)
    data.qpos[2] += 0.02
    mujoco.mj_forward(model, data)
    body = object_body(model)
    places = []
    while data.time < 4.0:
        mujoco.mj_step(model, data)
        if data.time >= 2.0:
            places.append(data.xipos[body].copy())
    return {
        "time_s": data.time,
        "moved_m": float(np.linalg.norm(np.ptp(places, axis=0))),
        "contacts": int(data.ncon),
    }


def table(path):
    """How far each free body is from where it was put, and from how it was turned, 2 s later."""
    model = compiled(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    bodies = [int(model.jnt_bodyid[n]) for n in range(model.njnt) if model.jnt_type[n] == mujoco.mjtJoint.mjJNT_FREE]
    before, turned = data.xipos.copy(), data.xquat.copy()
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    return [
        {
            "name": model.body(body).name,
            "mass_kg": float(model.body_mass[body]),
            "place_m": before[body].tolist(),
            "moved_m": float(np.linalg.norm(data.xipos[body] - before[body])),
            "turned_rad": float(2 * np.arccos(min(1.0, abs(data.xquat[body] @ turned[body])))),
        }
        for body in bodies
    ]


def lift(path, grasp):
    """Two pads press with the force, are raised by 0.1 m in 1 s, and wait 1 s."""
    tree, folder = with_plane(path)
    contacts = np.array(grasp["contacts_m"])
    axis = contacts[1] - contacts[0]
    width = np.linalg.norm(axis)
    axis /= width
    approach = np.array(grasp["approach"])
    middle = contacts.mean(axis=0)
    half, thick, gap, mass = grasp["finger_side_m"] / 2, 0.005, 0.005, 0.05
    text = lambda values: " ".join(repr(float(v)) for v in values)

    option = tree.find("option")
    option.set("cone", "elliptic")
    option.set("impratio", "10")
    option.set("noslip_iterations", "10")
    option.set("timestep", "0.001")
    world = tree.find("worldbody")
    hand = ET.SubElement(world, "body", name="hand", pos=text(middle), gravcomp="1")
    ET.SubElement(hand, "joint", name="raise", type="slide", axis="0 0 1", damping="2000")
    ET.SubElement(hand, "inertial", pos="0 0 0", mass="5", diaginertia="0.1 0.1 0.1")
    contact = tree.find("contact")
    contact = ET.SubElement(tree, "contact") if contact is None else contact
    actuator = ET.SubElement(tree, "actuator")
    equality = ET.SubElement(tree, "equality")
    for name, sign in (("left", -1), ("right", 1)):
        offset = sign * (width / 2 + gap + thick)
        pad = ET.SubElement(hand, "body", name=name, pos=text(axis * offset), gravcomp="1")
        ET.SubElement(pad, "joint", name=name, type="slide", axis=text(-sign * axis), damping="5")
        # The friction in contact is the larger of the two geoms': the object's.
        ET.SubElement(pad, "geom", name=name, type="box", size=text([thick, half, half]), mass=str(mass), condim="4",
                      friction="0 0.005 0.0001", xyaxes=text([*axis, *approach]))
        ET.SubElement(contact, "exclude", body1="world", body2=name)
    ET.SubElement(contact, "exclude", body1="left", body2="right")
    # Both fingers move alike, as a parallel gripper's do: together they press with twice the force of one.
    ET.SubElement(equality, "joint", joint1="left", joint2="right", polycoef="0 1 0 0 0", solref="0.004 1")
    ET.SubElement(actuator, "motor", name="left", joint="left")
    ET.SubElement(actuator, "motor", name="right", joint="right")
    ET.SubElement(actuator, "position", name="raise", joint="raise", kp="100000")

    model = from_tree(tree, folder)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, grasp["name"])
    turn = data.xmat[body].reshape(3, 3)
    gripped = turn.T @ (middle - data.xpos[body])
    place = lambda: data.xmat[body].reshape(3, 3) @ gripped + data.xpos[body]
    start = place().copy()
    forces = []
    while data.time < 2.5:
        # The force grows for 0.3 s: pads that it drives with all its strength from the start hit the object at meters per second.
        force = grasp["force_n"] * smooth(data.time / 0.3)
        data.ctrl[:] = [force, force, 0.1 * smooth(data.time - 0.5)]
        mujoco.mj_step(model, data)
        if 0.4 < data.time < 0.5:
            forces.append(normal_forces(model, data))
    return {
        "raised_m": float(place()[2] - start[2]),
        "hand_raised_m": float(data.qpos[model.joint("raise").qposadr[0]]),
        "pressed_n": np.mean(forces, axis=0).tolist(),
    }


def smooth(s):
    """From 0 at 0 to 1 at 1, at rest at both."""
    s = np.clip(s, 0.0, 1.0)
    return s**3 * (10 - 15 * s + 6 * s * s)


def normal_forces(model, data):
    """Force with which each pad presses, N."""
    sums = {"left": 0.0, "right": 0.0}
    for k in range(data.ncon):
        for geom in data.contact[k].geom:
            name = model.geom(int(geom)).name
            if name in sums:
                force = np.zeros(6)
                mujoco.mj_contactForce(model, data, k, force)
                sums[name] += force[0]
    return [sums["left"], sums["right"]]


def contacts(path):
    model = compiled(path)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return data.ncon


if __name__ == "__main__":
    what, *paths = sys.argv[1:]
    if what == "pads":
        result = pads(*paths)
    elif what == "lift":
        with open(paths[1]) as file:
            result = lift(paths[0], json.load(file))
    else:
        result = [{"load": load, "whole": whole, "rest": rest, "table": table, "contacts": contacts}[what](path) for path in paths]
    print(json.dumps(result))
