#!/usr/bin/env python3
"""Tries the places that `gprop grasp` proposes in MuJoCo, and prints what happened.

    pip install mujoco
    scripts/verify_grasps.py fixtures/hammer [fixtures/mug ...] [--work DIR] [--gripper FILE.toml] [--json FILE]

For each scene, the model that `gprop export --format mjcf` writes lies on a plane. Two flat pads with the gripper's area
press at each of the five best places, with F* and with 0.8 and 1.2 times F_min and with F_max (as far as the gripper can;
forces are those of one finger), rise by 20 cm in 1.5 s along the stated direction (straight up), shake by 5 mm at 2 Hz for
1 s, and hold for 2 s. "Slipped" is how far the gripped point of the object has moved in the hand, "turned" by how much the
object has. It is picked up if it ends within 2 cm of where the hand would have it.

If the scene has ground_truth/, the object has its true mass, and the pads the true friction of the part that they press on
(`gprop evaluate grasp` says which that is); forces are still those that gprop proposed.
"""

import argparse
import json
import math
import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import xml.etree.ElementTree as ET

try:
    import mujoco
    import numpy as np
except ImportError as error:
    sys.exit(f"{error.name} is missing: pip install mujoco")

GRAVITY = 9.8  # m/s2, as gprop has it
LIFT_M, SHAKE_M, SHAKE_HZ = 0.2, 0.005, 2.0
CLOSED_S, LIFTED_S, SHAKEN_S, END_S = 0.6, 2.1, 3.1, 5.1
TIMESTEP_S = 0.001
# Whatever ends farther from the hand than this has been lost.
HELD_M = 0.02


def numbers(values):
    return " ".join(repr(float(value)) for value in values)


def scene(folder, name, grasp, gripper, truth):
    """The exported body on a plane, and a hand with two pads at the place."""
    tree = ET.parse(os.path.join(folder, f"{name}.xml")).getroot()
    tree.insert(0, ET.Element("compiler", meshdir=folder, texturedir=folder))
    ET.SubElement(tree, "option", gravity=f"0 0 {-GRAVITY}", timestep=str(TIMESTEP_S), cone="elliptic", impratio="10",
                  noslip_iterations="10")
    world = tree.find("worldbody")
    body = world.find("body")
    if truth:
        inertial = body.find("inertial")
        factor = truth["mass_kg"] / float(inertial.get("mass"))
        inertial.set("mass", repr(truth["mass_kg"]))
        inertial.set("fullinertia", numbers(factor * float(v) for v in inertial.get("fullinertia").split()))
        # Contacts have the larger friction of two geoms, and the pads have none of their own.
        for geom in body.findall("geom"):
            if geom.get("friction"):
                geom.set("friction", f"{truth['friction']} 0.005 0.0001")

    first, second = np.array(grasp["contacts_m"])
    width = np.linalg.norm(second - first)
    axis, approach = (second - first) / width, np.array(grasp["approach"])
    middle = (first + second) / 2
    half, thick, gap = math.sqrt(gripper["finger_area_m2"]) / 2, 0.005, 0.005
    hand = ET.SubElement(world, "body", name="hand", pos=numbers(middle), gravcomp="1")
    ET.SubElement(hand, "joint", name="raise", type="slide", axis="0 0 1", damping="2000")
    ET.SubElement(hand, "inertial", pos="0 0 0", mass="5", diaginertia="0.1 0.1 0.1")
    contact, actuator, equality = (ET.SubElement(tree, tag) for tag in ("contact", "actuator", "equality"))
    for pad, sign in (("left", -1), ("right", 1)):
        finger = ET.SubElement(hand, "body", name=pad, pos=numbers(axis * sign * (width / 2 + gap + thick)), gravcomp="1")
        ET.SubElement(finger, "joint", name=pad, type="slide", axis=numbers(-sign * axis), damping="5")
        ET.SubElement(finger, "geom", name=pad, type="box", size=numbers([thick, half, half]), mass="0.05", condim="4",
                      friction="0 0.005 0.0001", xyaxes=numbers([*axis, *approach]), rgba="0.3 0.3 0.35 1")
        ET.SubElement(contact, "exclude", body1="world", body2=pad)
        ET.SubElement(actuator, "motor", name=pad, joint=pad)
    ET.SubElement(contact, "exclude", body1="left", body2="right")
    # Both fingers move alike, as a parallel gripper's do: together they press with twice the force of one.
    ET.SubElement(equality, "joint", joint1="left", joint2="right", polycoef="0 1 0 0 0", solref="0.004 1")
    ET.SubElement(actuator, "position", name="raise", joint="raise", kp="100000")
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
        if model.geom_type[geom] != mujoco.mjtGeom.mjGEOM_MESH or model.geom_contype[geom] == 0:
            continue
        mesh = model.geom_dataid[geom]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        turned = model.mesh_vert[first:first + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
        least = min(least, float(turned[:, 2].min()))
    return least


def height(time):
    """Where the hand is to be above its start."""
    share = min(max((time - CLOSED_S) / (LIFTED_S - CLOSED_S), 0.0), 1.0)
    lifted = LIFT_M * share**3 * (10 - 15 * share + 6 * share * share)
    if LIFTED_S < time < SHAKEN_S:
        lifted += SHAKE_M * math.sin(2 * math.pi * SHAKE_HZ * (time - LIFTED_S))
    return lifted


def attempt(model, name, middle, force):
    """Presses with the force, lifts, shakes, holds."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    body, hand = model.body(name).id, model.body("hand").id
    start_turn = data.xmat[body].reshape(3, 3).copy()
    gripped = start_turn.T @ (middle - data.xpos[body])
    place = lambda: data.xmat[body].reshape(3, 3) @ gripped + data.xpos[body]
    closed = None
    while data.time < END_S:
        data.ctrl[:] = [force, force, height(data.time)]
        mujoco.mj_step(model, data)
        if closed is None and data.time >= CLOSED_S:
            closed = place() - data.xpos[hand], data.xmat[body].reshape(3, 3).copy()
    slipped = float(np.linalg.norm(place() - data.xpos[hand] - closed[0]))
    cosine = (np.trace(closed[1].T @ data.xmat[body].reshape(3, 3)) - 1) / 2
    return {
        "force_n": force,
        "picked_up": bool(slipped < HELD_M and place()[2] - middle[2] > LIFT_M - HELD_M),
        "slipped_m": slipped,
        "turned_deg": math.degrees(math.acos(min(max(cosine, -1.0), 1.0))),
    }


def gprop(program, *arguments):
    done = subprocess.run([program, *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr.strip())
    return done.stdout


def verify(options, folder):
    work = options.work or os.path.join(folder, "gprop")
    with open(os.path.join(work, "grasp.json")) as file:
        report = json.load(file)
    truth = None
    if os.path.isdir(os.path.join(folder, "ground_truth")):
        judged = json.loads(gprop(options.gprop, "evaluate", "grasp", folder, "--out", work, "--json"))
        truth = judged["objects"][0] if judged.get("objects") else None
    gripper = options.profile
    most = gripper["force_n"][1]
    export = tempfile.mkdtemp()
    try:
        written = json.loads(gprop(options.gprop, "export", folder, "--work", work, "--format", "mjcf", "--out", export,
                                   "--json"))
        name = os.path.splitext(os.path.basename(written[0]))[0]
        places = []
        for number, grasp in enumerate(report["candidates"]):
            # The truth is known where the first place is; others on the same part share it.
            known = truth and {"mass_kg": truth["truth"]["mass_kg"], "friction": truth["truth"]["friction"]}
            if known and grasp["part_id"] != report["candidates"][0]["part_id"]:
                known = {"mass_kg": known["mass_kg"], "friction": report_friction(written[0], grasp)}
            model, middle = scene(export, name, grasp, gripper, known)
            forces = {
                "F*": grasp["f_star_n"],
                "0.8 F_min": 0.8 * grasp["f_min_n"],
                "1.2 F_min": min(1.2 * grasp["f_min_n"], most),
                "F_max": min(grasp["f_max_n"], most),
            }
            if number == 0:
                low, high = gripper["force_n"]
                forces |= {"MinGF": low, "MidGF": low + 45 / 85 * (high - low), "MaxGF": high}
            tried = {label: attempt(model, name, middle, force) for label, force in forces.items()}
            places.append({"part": grasp["part"], "feasible": grasp["feasible"],
                           "infeasible_because": grasp.get("infeasible_because"),
                           "f_min_n": grasp["f_min_n"], "torque_margin_n_m": grasp["torque_margin_n_m"], "tried": tried})
        return {"scene": os.path.basename(os.path.normpath(folder)), "truth": truth is not None,
                "true_f_min_n": truth and truth["true_f_min_n"], "true_f_max_n": truth and truth["true_f_max_n"],
                "feasible": report["feasible"], "places": places}
    finally:
        shutil.rmtree(export)


def report_friction(model, grasp):
    """The friction that gprop gives a part."""
    geoms = ET.parse(model).getroot().iter("geom")
    names = f"part{grasp['part_id']}_"
    return float(next(g for g in geoms if (g.get("name") or "").startswith(names)).get("friction").split()[0])


def table(results):
    """Every attempt, then the rates of the policies."""
    lines = ["| object, place | force | N | outcome | slipped, mm | turned, deg | torque margin, N m |",
             "| --- | --- | --- | --- | --- | --- | --- |"]
    for result in results:
        for number, place in enumerate(result["places"]):
            for label, tried in place["tried"].items():
                outcome = "picked up" if tried["picked_up"] else "lost"
                lines.append(f"| {result['scene']} {number + 1} | {label} | {tried['force_n']:.1f} | {outcome} | "
                             f"{1e3 * tried['slipped_m']:.1f} | {tried['turned_deg']:.0f} | "
                             f"{place['torque_margin_n_m']:.2f} |")
    lines += ["", "| policy | picked up (PUR), % | undamaged (NDR), % | objects |", "| --- | --- | --- | --- |"]
    for policy, label in (("MinGF", "MinGF"), ("MidGF", "MidGF"), ("MaxGF", "MaxGF"), ("gprop", "F*")):
        first = [(result, result["places"][0]["tried"][label]) for result in results if result["places"]]
        held = sum(tried["picked_up"] for _, tried in first)
        bounds = [(tried["force_n"], result["true_f_max_n"]) for result, tried in first if result["true_f_max_n"]]
        whole = sum(force <= bound for force, bound in bounds)
        ndr = f"{100 * whole / len(bounds):.0f}" if bounds else ""
        lines.append(f"| {policy} | {100 * held / max(len(first), 1):.0f} | {ndr} | {len(first)} |")
    return "\n".join(lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE")
    parser.add_argument("--work", metavar="DIR", help="work folder of the scene, if it is only one [default: SCENE/gprop]")
    default = os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "grippers", "paper.toml")
    parser.add_argument("--gripper", metavar="FILE.toml", default=default, help="the profile with which gprop planned")
    parser.add_argument("--gprop", metavar="PROGRAM", default="gprop")
    parser.add_argument("--json", metavar="FILE", help="write the outcomes here")
    options = parser.parse_args()
    if options.work and len(options.scenes) > 1:
        parser.error("--work is for one scene")
    with open(options.gripper, "rb") as file:
        options.profile = tomllib.load(file)
    results = [verify(options, folder) for folder in options.scenes]
    print(table(results))
    if options.json:
        with open(options.json, "w") as file:
            json.dump(results, file, indent=1)


if __name__ == "__main__":
    main()
