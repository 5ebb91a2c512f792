#!/usr/bin/env python3
"""Tries the places that `gprop grasp` proposes in MuJoCo, and prints what happened.

    pip install mujoco pillow
    scripts/verify_grasps.py fixtures/hammer [fixtures/mug ...] [--work DIR] [--gripper FILE.toml] [--json FILE]
    scripts/verify_grasps.py --check-pads                               # the pads on blocks and round bars
    scripts/verify_grasps.py --tried FILE.json [FILE.json ...]          # only the tables, from earlier runs

For each scene, the model that `gprop export --format mjcf` writes lies on a plane. The gripper has two parallel pads with the
profile's area, and opens no wider than its stroke. At each of the five best places, it closes with gprop's force and with F*, with 0.8 and 1.2 times
F_min, and with F_max (as far as the gripper can; forces are those of one finger). It rises by 20 cm in 1.5 s straight up, shakes
by 5 mm at 2 Hz for 1 s, and holds for 2 s. At the first place, it also tries the paper's fixed forces.

A pad is a disc of rubber, modelled as points that are spread evenly over it, each on a spring (a Winkler foundation), because
MuJoCo's own contacts of a box press with its corners and resist turning more than twice as hard as an evenly pressed disc. The
pads touch the model's visual mesh around the contacts, cut into prisms under its triangles; with `--touch colliders`, they touch
the convex colliders, which may reach beyond the object by more than a pad's width.

An object is "held" if at the end it has slid in the hand by less than 5 mm, "slid" if by less than 2 cm, else "lost". "Turned" is
by how much the object has turned in the hand since it was gripped. "By shape" is the share of the weight that the pads carry
with their normal forces, because something of the object rests on them; F_min is for flat, upright surfaces, where it is 0.

If the scene has ground_truth/, the object has its true mass, and the pads the true friction of the part that they press on, if
the ground truth has it; forces are still those that gprop proposed. 0.8 and 1.2 times the true F_min are tried too.
"""

import argparse
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET
from collections import Counter

try:
    import mujoco
    import numpy as np
    from PIL import Image
except ImportError as error:
    sys.exit(f"{error.name} is missing: pip install mujoco pillow")

GRAVITY = 9.8  # m/s2, as gprop has it
LIFT_M, SHAKE_M, SHAKE_HZ = 0.2, 0.005, 2.0
# The fingers press with their full force after PRESSED_S; the hand rises from CLOSED_S on.
PRESSED_S, CLOSED_S, LIFTED_S, SHAKEN_S, END_S = 0.5, 0.8, 2.3, 3.3, 5.3
# At a flat, grooved handle, MuJoCo needs shorter steps: with this one, a wrench is thrown out of the pads.
TIMESTEP_S = 0.002
# The object is held if it slid by less, and lost if it slid by more.
HELD_M, LOST_M = 0.005, 0.02
# More than the twist of the pads below the torque at which an object turns between them (`--check-pads`).
TURNED_DEG = 20.0
# A pad: soft rubber of 5 mm, so that it lies against a round handle too.
PAD_THICKNESS_M, PAD_YOUNGS_PA, PAD_POINTS, POINT_RADIUS_M = 0.005, 1e6, 12, 0.001
# A point on its spring oscillates at this rate: half a radian per time step.
POINT_RATE_1_S = 250.0
# The pads touch prisms of this depth, out to this distance from the pads.
MARGIN_M = 0.008
PRISM_M = 0.003
# Between a pad and the surface before the hand closes, if the stroke allows it.
GAP_M = 0.005


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def prisms(folder, name, grasp, radius):
    """Vertices of a prism under each triangle of the visual mesh that lies within `radius` of the line of the contacts."""
    vertices, triangles = [], []
    with open(os.path.join(folder, "meshes", f"{name}_skin.obj")) as file:
        for line in file:
            if line.startswith("v "):
                vertices.append([float(v) for v in line.split()[1:4]])
            elif line.startswith("f "):
                triangles.append([int(corner.split("/")[0]) - 1 for corner in line.split()[1:4]])
    vertices, triangles = np.array(vertices), np.array(triangles)
    corners = vertices[triangles]
    normals = np.zeros_like(vertices)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    for k in range(3):
        np.add.at(normals, triangles[:, k], areas)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    first, second = np.array(grasp["contacts_m"])
    axis = (second - first) / np.linalg.norm(second - first)
    off = np.linalg.norm(np.cross(vertices - first, axis), axis=1)
    for triangle in triangles[(off[triangles] < radius).any(axis=1)]:
        yield np.concatenate([vertices[triangle], vertices[triangle] - PRISM_M * normals[triangle]])


def scene(folder, name, grasp, gripper, truth, touch="skin", time_step_s=TIMESTEP_S):
    """The exported body on a plane, and a hand with two pads at the place."""
    tree = ET.parse(os.path.join(folder, f"{name}.xml")).getroot()
    tree.insert(0, ET.Element("compiler", meshdir=folder, texturedir=folder))
    ET.SubElement(tree, "option", gravity=f"0 0 {-GRAVITY}", timestep=str(time_step_s), cone="elliptic", impratio="100")
    world = tree.find("worldbody")
    body = world.find("body")
    inertial = body.find("inertial")
    if truth["mass_kg"]:
        factor = truth["mass_kg"] / float(inertial.get("mass"))
        inertial.set("mass", repr(truth["mass_kg"]))
        inertial.set("fullinertia", numbers(factor * float(v) for v in inertial.get("fullinertia").split()))
    # Bit 0 is for contacts with the floor, bit 1 for those with the pads. Contacts have the larger friction of two geoms, and
    # the pads have none.
    friction = f"{truth['friction']} 0 0"
    for geom in body.findall("geom"):
        if geom.get("friction") and touch == "colliders":
            geom.set("contype", "3")
            geom.set("friction", friction)
    radius = math.sqrt(gripper["finger_area_m2"] / math.pi)
    if touch == "skin":
        asset = tree.find("asset")
        for k, vertices in enumerate(prisms(folder, name, grasp, radius + MARGIN_M)):
            ET.SubElement(asset, "mesh", name=f"prism{k}", vertex=numbers(vertices.ravel()), inertia="shell")
            ET.SubElement(body, "geom", type="mesh", mesh=f"prism{k}", mass="0", contype="2", conaffinity="0", condim="3",
                          friction=friction, group="4")

    first, second = np.array(grasp["contacts_m"])
    width = np.linalg.norm(second - first)
    axis, approach = (second - first) / width, np.array(grasp["approach"])
    across = np.cross(axis, approach)
    middle = (first + second) / 2
    stroke = gripper.get("stroke_m", width + 2 * GAP_M)
    gap = min(GAP_M, max((stroke - width) / 2, 0.0))
    hand = ET.SubElement(world, "body", name="hand", pos=numbers(middle), gravcomp="1")
    ET.SubElement(hand, "joint", name="raise", type="slide", axis="0 0 1", damping="2000")
    # The hand moves along the fingers' axis until both press, and then stays.
    ET.SubElement(hand, "joint", name="center", type="slide", axis=numbers(axis), damping="50")
    ET.SubElement(hand, "inertial", pos="0 0 0", mass="5", diaginertia="0.1 0.1 0.1")
    actuator, equality = (ET.SubElement(tree, tag) for tag in ("actuator", "equality"))
    stiffness = PAD_YOUNGS_PA * gripper["finger_area_m2"] / PAD_THICKNESS_M / PAD_POINTS
    mass = stiffness / POINT_RATE_1_S**2
    for pad, sign in (("left", -1), ("right", 1)):
        finger = ET.SubElement(hand, "body", name=pad, pos=numbers(axis * sign * (width / 2 + gap)), gravcomp="1")
        ET.SubElement(finger, "joint", name=pad, type="slide", axis=numbers(-sign * axis), damping="50", limited="true",
                      range=f"{-(stroke - width) / 2 + gap - 1e-4} {width / 2 + gap}")
        ET.SubElement(finger, "inertial", pos="0 0 0", mass="0.05", diaginertia="1e-5 1e-5 1e-5")
        for k in range(PAD_POINTS):
            # Sunflower seeds: every point stands for the same area.
            off, turn = radius * math.sqrt((k + 0.5) / PAD_POINTS), k * math.pi * (3 - math.sqrt(5))
            at = across * off * math.cos(turn) + approach * off * math.sin(turn) + sign * axis * POINT_RADIUS_M
            point = ET.SubElement(finger, "body", pos=numbers(at), gravcomp="1")
            ET.SubElement(point, "joint", type="slide", axis=numbers(axis), stiffness=repr(stiffness),
                          damping=repr(2 * math.sqrt(stiffness * mass)))
            ET.SubElement(point, "geom", name=f"{pad}{k}", type="sphere", size=repr(POINT_RADIUS_M), mass=repr(mass), condim="3",
                          contype="0", conaffinity="2", friction="0 0 0", solmix="1000", solref="0.01 1")
        ET.SubElement(actuator, "motor", name=pad, joint=pad)
    # Both fingers move alike, as a parallel gripper's do: together they press with twice the force of one.
    ET.SubElement(equality, "joint", joint1="left", joint2="right", polycoef="0 1 0 0 0", solref="0.004 1")
    ET.SubElement(actuator, "position", name="raise", joint="raise", kp="100000")
    ET.SubElement(actuator, "position", name="center", joint="center", kp="100000")
    floor = ET.SubElement(world, "geom", name="floor", type="plane", size="5 5 1", friction="0.4 0.005 0.0001")
    model = compiled(tree, folder)
    floor.set("pos", f"0 0 {lowest(model)}")
    return compiled(tree, folder), middle


def compiled(tree, folder):
    path = os.path.join(folder, "tried.xml")
    ET.ElementTree(tree).write(path)
    return mujoco.MjModel.from_xml_path(path)


def lowest(model):
    """The least z of the object's colliders."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    least = math.inf
    for geom in range(model.ngeom):
        if not model.geom_contype[geom] & 1 or model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE:
            continue
        turn = data.geom_xmat[geom].reshape(3, 3)
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH:
            least = min(least, float(data.geom_xpos[geom][2] - np.abs(turn[2]) @ model.geom_aabb[geom][3:]))
            continue
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        turned = model.mesh_vert[first:first + count] @ turn.T + data.geom_xpos[geom]
        least = min(least, float(turned[:, 2].min()))
    return least


def height(time):
    """The height of the hand above its start."""
    share = min(max((time - CLOSED_S) / (LIFTED_S - CLOSED_S), 0.0), 1.0)
    lifted = LIFT_M * share**3 * (10 - 15 * share + 6 * share * share)
    if LIFTED_S < time < SHAKEN_S:
        since = time - LIFTED_S
        # The window lets it begin and end without a jerk.
        window = math.sin(math.pi * since / (SHAKEN_S - LIFTED_S)) ** 2
        lifted += SHAKE_M * window * math.sin(2 * math.pi * SHAKE_HZ * since)
    return lifted


def attempt(model, name, middle, force):
    """Presses with the force, lifts, shakes, holds."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body, hand = model.body(name).id, model.body("hand").id
    names = {f"{pad}{k}" for pad in ("left", "right") for k in range(PAD_POINTS)}
    pads = {geom for geom in range(model.ngeom) if model.geom(geom).name in names}
    center, center_at = model.actuator("center").id, model.joint("center").qposadr[0]
    stiff = float(model.actuator_gainprm[center, 0])
    model.actuator_gainprm[center, 0] = model.actuator_biasprm[center, 1] = 0.0
    gripped = data.xmat[body].reshape(3, 3).T @ (middle - data.xpos[body])
    place = lambda: data.xmat[body].reshape(3, 3) @ gripped + data.xpos[body]
    closed, borne, pressed = None, [], 0.0
    while data.time < END_S:
        press = force * min(data.time / PRESSED_S, 1.0)
        data.ctrl[:3] = [press, press, height(data.time)]
        mujoco.mj_step(model, data)
        if closed is None and data.time >= CLOSED_S:
            closed = place() - data.xpos[hand], data.xmat[body].reshape(3, 3).copy()
            pressed = sum(pad_forces(model, data, pads)[2]) / 2
            data.ctrl[center] = data.qpos[center_at]
            model.actuator_gainprm[center, 0], model.actuator_biasprm[center, 1] = stiff, -stiff
        if closed and place()[2] - data.xpos[hand][2] - closed[0][2] < -0.1:
            break
        if data.time > END_S - 0.5:
            borne.append(pad_forces(model, data, pads)[:2])
    slid = float(np.linalg.norm(place() - data.xpos[hand] - closed[0]))
    cosine = (np.trace(closed[1].T @ data.xmat[body].reshape(3, 3)) - 1) / 2
    normal, friction = np.mean(borne, axis=0) if borne else (0.0, 0.0)
    weight = GRAVITY * float(model.body_mass[body])
    off_floor = place()[2] - middle[2] > LIFT_M - LOST_M and abs(normal + friction - weight) < 0.1 * weight
    outcome = "lost" if slid > LOST_M or not off_floor else "held" if slid < HELD_M else "slid"
    return {
        "force_n": force,
        "pressed_n": pressed,
        "outcome": outcome,
        "slid_m": slid,
        "turned_deg": math.degrees(math.acos(min(max(cosine, -1.0), 1.0))),
        "by_shape": None if outcome == "lost" else normal / weight,
    }


def pad_forces(model, data, pads):
    """Upward parts of the normal forces and of the friction with which the pads hold the object, N; normal forces, N."""
    normal, friction, all_normal = 0.0, 0.0, []
    force = np.zeros(6)
    for k in range(data.ncon):
        contact = data.contact[k]
        if not pads & {int(contact.geom[0]), int(contact.geom[1])}:
            continue
        mujoco.mj_contactForce(model, data, k, force)
        # Rows: the normal, from the first geom to the second, and two tangents; the force is on the second.
        frame = contact.frame.reshape(3, 3)
        sign = -1.0 if int(contact.geom[1]) in pads else 1.0
        normal += sign * force[0] * frame[0, 2]
        friction += sign * float(force[1:3] @ frame[1:, 2])
        all_normal.append(force[0])
    return normal, friction, all_normal


def gprop(program, *arguments):
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr.strip())
    return done.stdout


def true_part(folder, work, grasp):
    """The true part at a place: the one that most of the used views show there, of those that a contact faces."""
    with open(os.path.join(folder, "ground_truth", "parts.json")) as file:
        parts = {part["id"]: part for part in json.load(file)["parts"]}
    with open(os.path.join(work, "views.json")) as file:
        views = json.load(file)
    first, second = np.array(grasp["contacts_m"])
    axis = (second - first) / np.linalg.norm(second - first)
    unit = (views.get("scale") or {}).get("meters_per_unit", 1.0)
    seen = Counter()
    for view in views["views"]:
        path = os.path.join(folder, "ground_truth", "part_maps", f"{view['name']}.png")
        if not os.path.exists(path):
            continue
        shown = np.array(Image.open(path))
        for contact, outward in ((first, -axis), (second, axis)):
            pixel, towards = projected(view, contact / unit)
            x, y = int(pixel[0]), int(pixel[1])
            if towards @ outward > 0.3 and 0 <= y < shown.shape[0] and 0 <= x < shown.shape[1] and int(shown[y, x]) in parts:
                seen[int(shown[y, x])] += 1
    return parts[min(seen, key=lambda part: (-seen[part], part))] if seen else None


def judged_truth(folder, work, grasp, exported):
    """The mass and the friction at the place with which a grasp is judged; the mass is None if it is unknown."""
    own = {"mass_kg": None, "friction": own_friction(exported, grasp), "part": None, "friction_is_true": False}
    if not os.path.exists(os.path.join(folder, "ground_truth", "parts.json")):
        return own
    with open(os.path.join(folder, "ground_truth", "parts.json")) as file:
        own["mass_kg"] = json.load(file)["total_mass_kg"]
    part = true_part(folder, work, grasp)
    if part:
        own["part"] = part["name"]
        if part.get("friction_rubber_pad"):
            own |= {"friction": part["friction_rubber_pad"], "friction_is_true": True}
    return own


def verify(options, folder):
    folder, _, work = folder.partition("=")
    work = work or options.work or os.path.join(folder, "gprop")
    with open(os.path.join(work, "grasp.json")) as file:
        report = json.load(file)
    gripper = options.profile
    low, most = gripper["force_n"]
    name = os.path.basename(os.path.normpath(folder))
    true_f_max = None
    if os.path.isdir(os.path.join(folder, "ground_truth")):
        # Not for every ground truth: it needs E and friction.
        done = subprocess.run([options.gprop, "evaluate", "grasp", folder, "--out", work, "--gripper", options.gripper, "--json"],
                              capture_output=True, text=True)
        if done.returncode == 0:
            true_f_max = json.loads(done.stdout)["objects"][0]["true_f_max_n"]
    export = tempfile.mkdtemp()
    try:
        written = json.loads(gprop(options.gprop, "export", folder, "--work", work, "--format", "mjcf", "--out", export, "--json"))
        model_file = written["files"][0]["path"]
        body = os.path.splitext(os.path.basename(model_file))[0]
        places = []
        for number, grasp in enumerate(report["candidates"]):
            truth = judged_truth(folder, work, grasp, model_file)
            model, middle = scene(export, body, grasp, gripper, truth, options.touch, options.time_step)
            forces = {
                "force": grasp["force_n"],
                "F*": grasp["f_star_n"],
                "0.8 F_min": 0.8 * grasp["f_min_n"],
                "1.2 F_min": min(1.2 * grasp["f_min_n"], most),
                "F_max": min(grasp["f_max_n"], most),
            }
            true_f_min = None
            if truth["mass_kg"]:
                true_f_min = truth["mass_kg"] * GRAVITY / 2 / truth["friction"]
                forces |= {"0.8 true F_min": 0.8 * true_f_min, "1.2 true F_min": 1.2 * true_f_min}
            if number == 0:
                forces |= {"MinGF": low, "MidGF": low + 45 / 85 * (most - low), "MaxGF": most}
            tried = {}
            weight = GRAVITY * (truth["mass_kg"] or report["inputs"]["mass_kg"]["mid"])
            for label, force in forces.items():
                same = [other for other in tried.values() if abs(other["force_n"] - force) < 1e-9]
                tried[label] = same[0] if same else attempt(model, body, middle, force)
                tried[label]["margin_n_m"] = torque_margin(truth["friction"], force, weight, grasp)
                print(f"{name} {number + 1}, {label}: {json.dumps(tried[label])}", file=sys.stderr)
            places.append({**{key: grasp[key] for key in ("part", "feasible", "infeasible_because", "force_n", "f_min_n", "f_max_n",
                                                            "f_hold_n", "f_star_n", "torque_margin_n_m", "width_m", "lever_m",
                                                            "offset_m", "touched_share", "pressure_arm_m", "pressure_shift_m",
                                                            "bend_rad")},
                           "truth": truth, "true_f_min_n": true_f_min, "tried": tried})
        return {"scene": name, "gripper": gripper["name"], "true_f_max_n": true_f_max, "feasible": report["feasible"],
                "infeasible": report["infeasible"], "places": places}
    finally:
        shutil.rmtree(export)


def grip_friction(friction, up, sideways):
    """The friction at which upright surfaces would carry as much as ones that lean by these angles (docs/grasp.md)."""
    return math.tan(math.acos(math.cos(math.atan(friction)) / math.cos(sideways)) - up)


def torque_margin(friction, force, weight, grasp):
    """The torque margin of docs/grasp.md at any force, with the friction and weight with which a grasp is judged."""
    arm, apart = grasp["pressure_arm_m"], grasp["width_m"]
    tilts = max(weight * grasp["offset_m"] - 2 * force * grasp["pressure_shift_m"], 0.0) / (friction * apart)
    taken = weight / 2 / friction + tilts
    spare, missing = math.sqrt(max(force * force - taken * taken, 0.0)), min(max(taken - force, 0.0), tilts)
    return friction * (2 * arm * spare - apart * missing) - weight * grasp["lever_m"]


def f_hold(friction, weight, grasp):
    """The least force at which the torque margin is not negative."""
    low, high = weight / 2 / friction, 1e6
    for _ in range(100):
        force = (low + high) / 2
        low, high = (force, high) if torque_margin(friction, force, weight, grasp) < 0.0 else (low, force)
    return high


def own_friction(model, grasp):
    """The friction that gprop gives a part."""
    with open(os.path.join(os.path.dirname(model), "asset.json")) as file:
        parts = json.load(file)["objects"][0]["parts"]
    name = next(part["name"] for part in parts if part["part"] == grasp["part_id"])
    geoms = ET.parse(model).getroot().iter("geom")
    return float(next(g for g in geoms if re.fullmatch(f"{name}_[0-9]+", g.get("name") or "")).get("friction").split()[0])


def projected(view, point):
    """Where a view without distortion shows a point, in pixels, and the unit vector from the point to the camera."""
    x, y, z, w = view["camera_from_world"]["rotation"]
    turn = np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])
    shift = np.array(view["camera_from_world"]["translation"])
    seen = turn @ point + shift
    towards = -turn.T @ shift - point
    lens = view["intrinsics"]
    pixel = (lens["fx"] * seen[0] / seen[2] + lens["cx"], lens["fy"] * seen[1] / seen[2] + lens["cy"])
    return pixel, towards / np.linalg.norm(towards)


# The reasons for which gprop says that the gripper cannot lift the object.
UNLIFTABLE = ("too_weak", "damage")


def table(results):
    """Every attempt, the rates of the policies, and where the simulator contradicts gprop."""
    lines = ["| object, place | gprop says | force | N | of true F_min | outcome | slid, mm | turned, deg | torque margin, N m | "
             "by shape, % |", "| --- " * 10 + "|"]
    for result in results:
        for number, place in enumerate(result["places"]):
            says = place["infeasible_because"] or "feasible"
            for label, tried in place["tried"].items():
                share = tried["force_n"] / place["true_f_min_n"] if place["true_f_min_n"] else math.nan
                lost = tried["outcome"] == "lost"
                # With more force, normal forces and friction may carry any shares that add up to the weight.
                shape = f"{100 * tried['by_shape']:.0f}" if not lost and share < 1.0 else ""
                cells = [f"{result['scene']} {number + 1}", says, label, f"{tried['force_n']:.1f}",
                         "" if math.isnan(share) else f"{share:.2f}", tried["outcome"],
                         "" if lost else f"{1e3 * tried['slid_m']:.1f}", "" if lost else f"{tried['turned_deg']:.0f}",
                         f"{place['torque_margin_n_m']:.2f}" if label == "force" else "", shape]
                lines.append("| " + " | ".join(cells) + " |")
    return "\n".join([*lines, "", *first_places(results), "", *policies(results), "", *checks(results)])


def first_places(results):
    """The first place of each object under every policy."""
    lines = ["| object | true part | force | F_min | F* | F_max | true F_min | true F_max | gprop says | " + " | ".join(POLICIES) + " |",
             "| --- " * (9 + len(POLICIES)) + "|"]
    number = lambda value: "" if value is None else f"{value:.1f}" if value < 100 else f"{value:.0f}"
    for result in results:
        for place in result["places"][:1]:
            words = [word(place["tried"][label]) for label in POLICIES.values()]
            truth = place["truth"]
            star = "" if truth["friction_is_true"] else "*"
            forces = [number(place[key]) for key in ("force_n", "f_min_n", "f_star_n", "f_max_n", "true_f_min_n")]
            forces[4] += star
            cells = [result["scene"], truth["part"] or "", *forces, number(result["true_f_max_n"]),
                     place["infeasible_because"] or "feasible", *words]
            lines.append("| " + " | ".join(cells) + " |")
    return lines


# Name of each policy and of its force.
POLICIES = {"MinGF": "MinGF", "MidGF": "MidGF", "MaxGF": "MaxGF", "F*": "F*", "gprop": "force"}


def word(tried):
    turned = tried["outcome"] != "lost" and tried["turned_deg"] > TURNED_DEG
    return tried["outcome"] + (f", turned {tried['turned_deg']:.0f} deg" if turned else "")


def policies(results):
    lines = ["| policy | picked up (PUR), % | without turning, % | undamaged (NDR), % of |", "| --- | --- | --- | --- |"]
    for policy, label in POLICIES.items():
        first = [(result, result["places"][0]["tried"][label]) for result in results if result["places"]]
        held = [tried for _, tried in first if tried["outcome"] == "held"]
        still = sum(tried["turned_deg"] <= TURNED_DEG for tried in held)
        bounds = [(tried["force_n"], result["true_f_max_n"]) for result, tried in first if result["true_f_max_n"]]
        whole = sum(force <= bound for force, bound in bounds)
        ndr = f"{100 * whole / len(bounds):.0f} of {len(bounds)}" if bounds else ""
        percent = lambda count: f"{100 * count / max(len(first), 1):.0f}"
        lines.append(f"| {policy} | {percent(len(held))} | {percent(still)} | {ndr} |")
    return lines


def checks(results):
    """Statements that must hold if F_min and the torque margin are right, and the places at which they do not."""
    places = [(f"{result['scene']} {number + 1}", place) for result in results for number, place in enumerate(result["places"])]
    liftable = [(where, place) for where, place in places if place["infeasible_because"] not in UNLIFTABLE]
    others = [(where, place) for where, place in places if place["infeasible_because"] in UNLIFTABLE]
    judged = [(where, place) for where, place in places if place["true_f_min_n"]]
    still = lambda tried: tried["outcome"] == "held"
    turned = lambda tried: tried["outcome"] != "lost" and tried["turned_deg"] > TURNED_DEG

    def says(text, among, holds):
        names = [where for where, place in among if not holds(place)]
        return f"- {text}: {len(among) - len(names)} of {len(among)} places" + (f"; not {', '.join(names)}" if names else "")

    return [
        says("held with gprop's force if gprop says that the gripper can lift the object", liftable,
             lambda p: still(p["tried"]["force"])),
        says("held with F* if gprop says that the gripper can lift the object", liftable, lambda p: still(p["tried"]["F*"])),
        says("lost with gprop's force if gprop says that it cannot", others, lambda p: p["tried"]["force"]["outcome"] == "lost"),
        says(f"not turned by more than {TURNED_DEG:.0f} degrees with gprop's force, or the torque margin is negative", places,
             lambda p: not turned(p["tried"]["force"]) or p["torque_margin_n_m"] < 0.0),
        says("slid by 5 mm or more at 0.8 F_min", places, lambda p: not still(p["tried"]["0.8 F_min"])),
        says("slid by 5 mm or more at 0.8 true F_min", judged, lambda p: not still(p["tried"]["0.8 true F_min"])),
        says("held at 1.2 true F_min, or the torque margin at that force is negative", judged,
             lambda p: still(p["tried"]["1.2 true F_min"]) or p["tried"]["1.2 true F_min"]["margin_n_m"] < 0.0),
    ]


UPRIGHT = (0.0, 0.0)


def leaning(up_deg, sideways_deg):
    """A block of 40 mm between the pads whose two walls face up, and towards +y, by these angles."""
    up, sideways = math.radians(up_deg), math.radians(sideways_deg)
    corners = []
    for y in (-0.05, 0.05):
        for z in (-0.05, 0.05):
            half = 0.02 - y * math.tan(sideways) - z * math.tan(up)
            corners += [[-half, y, z], [half, y, z]]
    # The angle between the normal (1, tan sideways, tan up) and the plane of the fingers' line and of the lift.
    out = math.asin(math.tan(sideways) / math.sqrt(1 + math.tan(sideways) ** 2 + math.tan(up) ** 2))
    mesh = f'<asset><mesh name="block" vertex="{numbers(np.ravel(corners))}"/></asset>'
    return mesh, '<geom type="mesh" mesh="block"', (up, out)


# Shapes of 40 mm between the pads, which press along x: assets, geom, inclination under both pads.
SHAPES = {
    "block": ("<asset/>", '<geom type="box" size="0.02 0.05 0.05"', UPRIGHT),
    "upright bar": ("<asset/>", '<geom type="cylinder" size="0.02 0.05"', UPRIGHT),
    "lying bar": ("<asset/>", '<geom type="cylinder" size="0.02 0.05" euler="90 0 0"', UPRIGHT),
    "narrows upwards, 7 deg": leaning(7.0, 0.0),
    "widens upwards, 7 deg": leaning(-7.0, 0.0),
    "narrows sideways, 14 deg": leaning(0.0, 14.0),
}

# What stands on the floor while the hand closes if the centre of mass is beside the shape; the pads do not touch it.
FOOT_Z_M = {"block": -0.048, "lying bar": -0.018}


def check_pads(gripper):
    """Compares the pads with the formulas of F_min, of the torque margin and of F_hold, on shapes for which these are meant."""
    mass, friction = 0.5, 0.6
    weight = mass * GRAVITY
    arm = 2 / 3 * math.sqrt(gripper["finger_area_m2"] / math.pi)
    print("| shape | N | lever, mm | offset, mm | of F_min | of the torque | of F_hold | outcome | slid, mm | turned, deg |",
          "| --- " * 10 + "|", sep="\n")
    with tempfile.TemporaryDirectory() as folder:
        for shape, (asset, geom, inclination) in SHAPES.items():
            f_min = weight / 2 / grip_friction(friction, *inclination)
            # The bar rolls under the pads if it turns about its own axis.
            shift = 0.0 if shape == "lying bar" else 3 / 8 * arm
            level = {"pressure_arm_m": arm, "pressure_shift_m": shift, "width_m": 0.04, "lever_m": 0.0, "offset_m": 0.0}
            trials = [(share * f_min, level, 0.0) for share in (0.8, 0.9, 0.95, 1.1, 1.2)]
            for force in (10.0, 40.0) if inclination is UPRIGHT else ():
                most = torque_margin(friction, force, weight, level) / weight
                trials += [(force, level | {"lever_m": share * most}, share) for share in (0.5, 0.85, 1.1, 1.2)]
            # Beside both fingers, and beside them and off their line.
            for offset, lever in ((0.04, 0.0), (0.07, 0.0), (0.07, 0.01)) if shape in FOOT_Z_M else ():
                beside = level | {"lever_m": lever, "offset_m": offset}
                trials += [(share * f_hold(friction, weight, beside), beside, 0.0) for share in (0.5, 0.8, 0.9, 1.0, 1.1, 1.2)]
            for force, place, share in trials:
                lever, foot = place["lever_m"], ""
                if place["offset_m"]:
                    foot = f'<geom type="box" size="0.12 0.05 0.002" pos="0 0 {FOOT_Z_M[shape]}"/>'
                if shape == "upright bar" and lever > 0.02:
                    continue  # It would fall over.
                with open(os.path.join(folder, "body.xml"), "w") as file:
                    file.write(f'<mujoco>{asset}<worldbody><body name="body"><freejoint/><inertial pos="{place["offset_m"]} {lever} 0" mass="{mass}" '
                               f'fullinertia="0.001 0.001 0.001 0 0 0"/>{foot}{geom} friction="{friction}"/></body></worldbody></mujoco>')
                grasp = {"contacts_m": [[-0.02, 0.0, 0.0], [0.02, 0.0, 0.0]], "approach": [0.0, 0.0, 1.0]}
                truth = {"mass_kg": mass, "friction": friction}
                model, middle = scene(folder, "body", grasp, gripper, truth, "colliders")
                tried = attempt(model, "body", middle, force)
                print(f"| {shape} | {force:.1f} | {1e3 * lever:.1f} | {1e3 * place['offset_m']:.1f} | {force / f_min:.2f} | {share:.2f} | "
                      f"{force / f_hold(friction, weight, place):.2f} | {tried['outcome']} | "
                      f"{1e3 * tried['slid_m']:.1f} | {tried['turned_deg']:.0f} |", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="*", metavar="SCENE[=WORK]", help="scene, and its work folder if it is not SCENE/gprop")
    parser.add_argument("--work", metavar="DIR", help="work folder of the scene, if there is only one [default: SCENE/gprop]")
    default = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "grippers", "paper.toml")
    parser.add_argument("--gripper", metavar="FILE.toml", default=default, help="the profile with which gprop planned")
    parser.add_argument("--touch", choices=["skin", "colliders"], default="skin", help="what the pads touch [default: skin]")
    parser.add_argument("--time-step", metavar="SECONDS", type=float, default=TIMESTEP_S, help="of the simulation [default: %(default)s]")
    parser.add_argument("--gprop", metavar="PROGRAM", default="gprop")
    parser.add_argument("--check-pads", action="store_true", help="compare the pads with the formulas, on blocks and round bars")
    parser.add_argument("--json", metavar="FILE", help="write the outcomes here")
    parser.add_argument("--tried", metavar="FILE", nargs="+", default=[], help="outcomes of earlier runs to include in the tables")
    options = parser.parse_args()
    if options.work and len(options.scenes) > 1:
        parser.error("--work is for one scene; write SCENE=WORK")
    if not options.scenes and not options.tried and not options.check_pads:
        parser.error("no scene")
    with open(options.gripper, "rb") as file:
        options.profile = tomllib.load(file)
    if options.check_pads:
        check_pads(options.profile)
        return
    results = []
    for path in options.tried:
        with open(path) as file:
            results += json.load(file)
    results += [verify(options, folder) for folder in options.scenes]
    print(table(results))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
