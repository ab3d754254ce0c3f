"""The robot model: icub-models' URDF, converted once into a form Drake loads, kept in a user cache.

As shipped the file cannot be parsed by Drake (STL collision meshes, no motors, placeholder limits).
The conversion thins the visual meshes, fixes legs and neck, replaces collision meshes by primitives and
gives it the hands of `sim.hands`. It never touches the installed package.
"""

from __future__ import annotations

import hashlib
import inspect
import math
import os
import re
import shutil
import tempfile
import xml.etree.ElementTree as ET
from importlib.metadata import version
from pathlib import Path

import numpy as np

from cognitive_arch.errors import BackendError, one_line
from sim import hand_parts, hands, meshes

MODEL = "iCubGazeboV2_7"
MESH_CELL, HIDDEN_MESH_CELL = 0.006, 0.014
"""Side (metres) of the cubes in which mesh corners are merged; coarser for what the table hides."""

EFFORT = {"torso": 80.0, "shoulder": 60.0, "elbow": 30.0, "wrist": 8.0}  # N m
VELOCITY = 3.0  # rad/s
DAMPING = 0.5  # N m s/rad
NECK_DOWN = {"neck_pitch": -0.60}  # rad, looks at the table in front of the robot
FOREARM = {"radius": 0.033, "length": 0.10}  # m, a capsule along z of its link
FOREARM_AT = {"l": (0.043, 0.0, 0.007), "r": (-0.043, 0.0, 0.007)}  # m, its middle
UPPER_ARM = {"radius": 0.040, "length": 0.06}  # m
TRUNK = {  # link: centre and size of a box in its frame, m
    "root_link": ((0.03, 0.0, -0.06), (0.14, 0.20, 0.18)),
    "torso_2": ((0.0, 0.045, 0.055), (0.08, 0.14, 0.09)),
    "chest": ((0.0, 0.076, -0.06), (0.21, 0.21, 0.25)),
}
HEAD = ((-0.007, 0.119, -0.016), 0.085)  # m, centre and radius of a ball in the frame of the link
_FIXED = re.compile(r"hip|knee|ankle|neck")
_HIDDEN = re.compile(r"hip|knee|ankle|foot|sole|leg|root_link")
_KEEP = re.compile(r"dh_frame|^imu|root_link|base_link")


def cache_folder() -> Path:
    """Folder of the converted model: its name changes with the versions and with this code."""
    base = os.environ.get("XDG_CACHE_HOME")
    root = Path(base) if base else Path.home() / ".cache"
    recipe = "".join(inspect.getsource(part) for part in (hand_parts, hands, meshes)) + Path(
        __file__
    ).read_text("utf-8")
    digest = hashlib.sha256(recipe.encode("utf-8")).hexdigest()[:10]
    return root / "cognitive_arch" / f"icub-models-{version('icub-models')}-{digest}"


def robot_urdf() -> Path:
    """Path of the converted URDF; converts on first use (about 3 s).

    The folder is written under a temporary name and renamed when complete, so neither a kill nor two
    processes at once leave a broken cache. Raises `BackendError` when the folder cannot be written.
    """
    folder = cache_folder()
    urdf = folder / "icub.urdf"
    if urdf.exists():
        return urdf
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        work = Path(tempfile.mkdtemp(prefix="converting-", dir=folder.parent))
    except OSError as error:
        raise BackendError(f"cannot write the robot model cache {folder.parent}: {one_line(error)}") from None
    try:
        convert(work)
        try:
            work.rename(folder)
        except OSError:
            # Another process was faster; its folder is as good as ours.
            if not urdf.exists():
                raise
    finally:
        shutil.rmtree(work, ignore_errors=True)
    return urdf


def _source() -> Path:
    """Folder `share/iCub` of the installed icub-models package."""
    try:
        import icub_models
    except ImportError:
        raise BackendError("the robot model is missing; install it with: pip install icub-models") from None
    path = Path(icub_models.get_models_path())
    if path.name == "robots":
        return path.parent
    return path / "iCub" if (path / "iCub").exists() else path


def rotation(rpy: tuple[float, float, float]) -> meshes.Array:
    """Rotation matrix of URDF's roll, pitch, yaw (radians)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def roll_pitch_yaw(matrix: meshes.Array) -> tuple[float, float, float]:
    """Roll, pitch, yaw (radians) of a rotation matrix; the inverse of `rotation`."""
    horizontal = math.hypot(matrix[0, 0], matrix[1, 0])
    return (
        math.atan2(matrix[2, 1], matrix[2, 2]),
        math.atan2(-matrix[2, 0], horizontal),
        math.atan2(matrix[1, 0], matrix[0, 0]),
    )


def _numbers(value: str | None, default: str = "0 0 0") -> tuple[float, float, float]:
    a, b, c = (float(part) for part in (value or default).split())
    return a, b, c


def _strip(robot: ET.Element) -> None:
    """Remove what Drake does not use: simulator tags and the massless skin and sensor frames."""
    for tag in ("gazebo", "sensor", "transmission"):
        for element in robot.findall(tag):
            robot.remove(element)
    heavy = {link.get("name"): link.find("inertial") is not None for link in robot.findall("link")}
    parents = {joint.find("parent").get("link") for joint in robot.findall("joint")}  # type: ignore[union-attr]
    dropped = set()
    for joint in robot.findall("joint"):
        child = joint.find("child").get("link")  # type: ignore[union-attr]
        bare = child is not None and not heavy[child] and child not in parents and not _KEEP.search(child)
        if joint.get("type") == "fixed" and bare:
            robot.remove(joint)
            dropped.add(child)
    for link in robot.findall("link"):
        if link.get("name") in dropped:
            robot.remove(link)


def _fix_joint(joint: ET.Element, angle: float) -> None:
    """Turn a revolute joint into a fixed one that keeps `angle` (radians)."""
    origin, axis = joint.find("origin"), joint.find("axis")
    assert origin is not None
    assert axis is not None
    x, y, z = _numbers(axis.get("xyz"))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross
    origin.set("rpy", hand_parts.text(roll_pitch_yaw(rotation(_numbers(origin.get("rpy"))) @ turn)))
    joint.set("type", "fixed")
    for tag in ("limit", "dynamics", "axis"):
        element = joint.find(tag)
        if element is not None:
            joint.remove(element)


def _motorise(robot: ET.Element) -> None:
    """Fix legs and neck; give every other joint real limits, damping and a motor."""
    for joint in [j for j in robot.findall("joint") if j.get("type") == "revolute"]:
        name = joint.get("name") or ""
        if _FIXED.search(name):
            _fix_joint(joint, NECK_DOWN.get(name, 0.0))
            continue
        limit, dynamics = joint.find("limit"), joint.find("dynamics")
        assert limit is not None
        effort = next(value for key, value in EFFORT.items() if key in name)
        limit.set("effort", f"{effort:g}")
        limit.set("velocity", f"{VELOCITY:g}")
        if dynamics is None:
            dynamics = ET.SubElement(joint, "dynamics")
        dynamics.set("damping", f"{DAMPING:g}")
        dynamics.set("friction", "0")
        hand_parts.add_actuator(robot, name)


def _convert_meshes(robot: ET.Element, source: Path, folder: Path) -> None:
    """Write every visual mesh once as a thinned OBJ; drop all mesh collisions."""
    written: set[str] = set()
    for link in robot.findall("link"):
        cell = HIDDEN_MESH_CELL if _HIDDEN.search(link.get("name") or "") else MESH_CELL
        for collision in link.findall("collision"):
            link.remove(collision)
        for mesh in link.iterfind("visual/geometry/mesh"):
            path = source / (mesh.get("filename") or "").replace("package://iCub/", "")
            target = path.stem + ".obj"
            if target not in written:
                triangles = meshes.read_stl(path) * np.array(_numbers(mesh.get("scale"), "1 1 1"))
                if link.get("name") in ("l_hand", "r_hand"):
                    triangles = _without_fingers(robot, link, triangles)
                meshes.write_obj(folder / target, *meshes.decimate(triangles, cell))
                written.add(target)
            mesh.set("filename", target)
            mesh.attrib.pop("scale", None)


def _without_fingers(robot: ET.Element, link: ET.Element, triangles: meshes.Array) -> meshes.Array:
    """The hand's mesh with fingers and thumb pressed flat onto the palm, so that no hole stays."""

    def pose(element: ET.Element | None) -> tuple[meshes.Array, meshes.Array]:
        assert element is not None
        return rotation(_numbers(element.get("rpy"))), np.array(_numbers(element.get("xyz")))

    R_LM, p_LM = pose(link.find("visual/origin"))
    R_LH, p_LH = pose(robot.find(f"joint[@name='{link.get('name')}_dh_frame_fixed_joint']/origin"))
    p_H = (triangles @ R_LM.T + p_LM - p_LH) @ R_LH
    p_H[..., 0] = np.minimum(p_H[..., 0], hands.PALM[1])
    p_H[..., 1] = np.maximum(p_H[..., 1], -hands.PALM[2] / 2 - 0.004)
    mesh: meshes.Array = (p_H @ R_LH.T + p_LH - p_LM) @ R_LM
    return mesh


def _add_arm(links: dict[str | None, ET.Element], side: str) -> None:
    """Capsules along z of the forearm and of the upper arm."""
    for name, centre, size in (
        ("forearm", FOREARM_AT[side], FOREARM),
        ("upper_arm", (-0.015, 0.0, 0.030), UPPER_ARM),
    ):
        capsule = ET.SubElement(links[f"{side}_{name}"], "collision", name=f"{side}_{name}")
        ET.SubElement(capsule, "origin", xyz=hand_parts.text(centre), rpy="0 0 0")
        geometry = ET.SubElement(capsule, "geometry")
        sizes = {key: f"{value:g}" for key, value in size.items()}
        ET.SubElement(geometry, f"{hand_parts.DRAKE}capsule", sizes)
        hand_parts.add_contact(capsule, hands.FINGER_FRICTION)


def _add_trunk(links: dict[str | None, ET.Element]) -> None:
    """Boxes and a ball for what the arms must not reach through."""
    for name, (centre, size) in TRUNK.items():
        box = hand_parts.add_box(links[name], "collision", name, centre, size)
        hand_parts.add_contact(box, hands.FINGER_FRICTION)
    ball = ET.SubElement(links["head"], "collision", name="head")
    ET.SubElement(ball, "origin", xyz=hand_parts.text(HEAD[0]), rpy="0 0 0")
    ET.SubElement(ET.SubElement(ball, "geometry"), "sphere", radius=f"{HEAD[1]:g}")
    hand_parts.add_contact(ball, hands.FINGER_FRICTION)


def convert(folder: Path) -> Path:
    """Write `icub.urdf` and its meshes into `folder`; returns the URDF's path."""
    ET.register_namespace("drake", hand_parts.DRAKE.strip("{}"))
    source = _source()
    tree = ET.parse(source / "robots" / MODEL / "model.urdf")
    robot = tree.getroot()
    _strip(robot)
    _convert_meshes(robot, source, folder)
    _motorise(robot)
    links = {link.get("name"): link for link in robot.findall("link")}
    _add_trunk(links)
    for side in sorted(hands.PALM_SIGN):
        _add_arm(links, side)
        hand_parts.add_palm(links[f"{side}_hand_dh_frame"], side)
        hand_parts.add_fingers(robot, side)
        hand_parts.add_gripper(robot, side)
    urdf = folder / "icub.urdf"
    tree.write(urdf, encoding="utf-8", xml_declaration=True)
    return urdf
