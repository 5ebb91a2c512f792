"""Loads URDFs or worlds in PyBullet and prints what it finds of each as a list in JSON.

pybullet_check.py URDF...    per link, with the base first: mass, centre, inertia, friction, restitution, what is shown and what collides
pybullet_check.py SDF...     per body that moves: mass, friction, place, and how far it is moved and turned 2 s later
"""

import ctypes
import json
import math
import os
import sys

import pybullet

BASE = -1


def loaded(path):
    client = pybullet.connect(pybullet.DIRECT)
    try:
        body = pybullet.loadURDF(path, flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        shown = pybullet.getVisualShapeData(body)
        links = range(BASE, pybullet.getNumJoints(body))
        found = {"links": [link_of(body, link, shown) for link in links]}
        return {**found, "falls_m": fall(body)}
    finally:
        pybullet.disconnect(client)


def fall(body):
    """How far it falls in half a second."""
    pybullet.setGravity(0, 0, -9.8)
    before = pybullet.getBasePositionAndOrientation(body)[0]
    for _ in range(120):
        pybullet.stepSimulation()
    return before[2] - pybullet.getBasePositionAndOrientation(body)[0][2]


def world(path):
    client = pybullet.connect(pybullet.DIRECT)
    try:
        pybullet.setGravity(0, 0, -9.8)
        bodies = pybullet.loadSDF(path)
        moving = [body for body in bodies if pybullet.getDynamicsInfo(body, BASE)[0] > 0]
        before = [pybullet.getBasePositionAndOrientation(body) for body in moving]
        for _ in range(480):
            pybullet.stepSimulation()
        after = [pybullet.getBasePositionAndOrientation(body) for body in moving]
        return {"static": len(bodies) - len(moving), "bodies": list(map(moved, moving, before, after))}
    finally:
        pybullet.disconnect(client)


def moved(body, before, after):
    mass, friction = pybullet.getDynamicsInfo(body, BASE)[:2]
    same = abs(sum(a * b for a, b in zip(before[1], after[1])))
    return {
        "mass_kg": mass,
        "friction": friction,
        "place_m": before[0],
        "moved_m": math.dist(before[0], after[0]),
        "turned_rad": 2 * math.acos(min(1.0, same)),
    }


def link_of(body, link, shown):
    mass, friction, inertia, center, _, restitution = pybullet.getDynamicsInfo(body, link)[:6]
    low, high = pybullet.getAABB(body, link)
    meshes = [shape for shape in shown if shape[1] == link and shape[2] == pybullet.GEOM_MESH]
    names = pybullet.getBodyInfo(body)[0] if link == BASE else pybullet.getJointInfo(body, link)[12]
    return {
        "name": names.decode(),
        "mass_kg": mass,
        "center_of_mass_m": center,
        "principal_inertia_kg_m2": inertia,
        "friction": friction,
        "restitution": restitution,
        "shown": [{"file": os.path.basename(shape[4].decode()), "scale": shape[3]} for shape in meshes],
        "colliders": len(pybullet.getCollisionShapeData(body, link)),
        "collider_size_m": [b - a for a, b in zip(low, high)],
    }


found = [world(path) if path.endswith(".sdf") else loaded(path) for path in sys.argv[1:]]
# PyBullet prints warnings without the end of their line.
ctypes.CDLL(None).fflush(None)
print(f"\n{json.dumps(found)}")
