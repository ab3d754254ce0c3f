"""The hands of `sim.hands`, written as URDF elements."""

from __future__ import annotations

import itertools
import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

from sim.hands import (
    DRAWN_IN,
    FINGER_FORCE,
    FINGER_FRICTION,
    FINGER_LENGTH,
    FINGER_OFFSET,
    FINGER_RADIUS,
    FINGER_THICKNESS,
    FINGER_WIDTH,
    FINGERS_AT,
    HOUSING,
    KNUCKLE,
    PAD_RADIUS,
    PAD_STIFFNESS,
    PALM,
    PALM_SIGN,
    PHALANGES,
    STROKE,
    THUMB,
    THUMB_RADIUS,
    carriage_name,
    finger_names,
    knuckle_names,
    phalanx_names,
)

DRAKE = "{http://drake.mit.edu}"
CARRIAGE_FORCE = 60.0  # N
KNUCKLE_TORQUE = 2.0  # N m
MAX_BEND = 1.6  # rad
ARM = 0.034  # m, on which a pad slides out sideways

# Metres above the tip and across the pad. Two columns cradle a round slice: a single middle one would
# hold it in two points, off which it creeps as soon as it is not met exactly in its diameter. Three rows
# meet even a slice of 10 mm in two, so that it cannot swing about the line between the pads. The outer
# columns are for tools, which would else turn in the hand by half a degree per second.
_PAD_ROWS = (0.0025, 0.0055, 0.0085, 0.016, 0.030, 0.045)
_PAD_COLUMNS = (-0.018, -0.010, 0.010, 0.018)
_RUBBER = "0.13 0.14 0.16 1"
_METAL = "0.62 0.64 0.68 1"
_SHELL = "0.86 0.86 0.87 1"

Point = tuple[float, float, float]


def text(values: Sequence[float]) -> str:
    """Numbers as URDF wants them."""
    return " ".join(f"{v:.9g}" for v in values)


def _paint(visual: ET.Element, name: str, color: str) -> None:
    ET.SubElement(ET.SubElement(visual, "material", name=f"{name}_material"), "color", rgba=color)


def add_box(
    link: ET.Element,
    tag: str,
    name: str,
    centre: Sequence[float],
    size: Sequence[float],
    *,
    color: str = _METAL,
) -> ET.Element:
    """Add a box (metres, link frame) as `visual` or `collision` of a link; returns the element."""
    element = ET.SubElement(link, tag, name=name)
    ET.SubElement(element, "origin", xyz=text(centre), rpy="0 0 0")
    ET.SubElement(ET.SubElement(element, "geometry"), "box", size=text(size))
    if tag == "visual":
        _paint(element, name, color)
    return element


def add_contact(collision: ET.Element, friction: float) -> None:
    """Give a collision element its friction coefficient and stiffness."""
    properties = ET.SubElement(collision, f"{DRAKE}proximity_properties")
    for key in ("mu_static", "mu_dynamic"):
        ET.SubElement(properties, f"{DRAKE}{key}", value=f"{friction:g}")
    ET.SubElement(properties, f"{DRAKE}point_contact_stiffness", value=f"{PAD_STIFFNESS:g}")


def _add_limb(link: ET.Element, name: str, a: Point, b: Point, radius: float, color: str) -> None:
    """A capsule from `a` to `b` (metres, link frame), to be seen and touched."""
    along = [end - start for start, end in zip(a, b, strict=True)]
    length = math.hypot(*along)
    # Capsules lie along z; this roll and pitch turn z to where the limb goes.
    pitch = math.atan2(math.hypot(along[0], along[1]), along[2])
    yaw = math.atan2(along[1], along[0])
    centre = [(start + end) / 2 for start, end in zip(a, b, strict=True)]
    for tag in ("visual", "collision"):
        element = ET.SubElement(link, tag, name=name)
        ET.SubElement(element, "origin", xyz=text(centre), rpy=text((0, pitch, yaw)))
        size = {"radius": f"{radius:g}", "length": f"{length:g}"}
        ET.SubElement(ET.SubElement(element, "geometry"), f"{DRAKE}capsule", size)
        if tag == "visual":
            _paint(element, name, color)
        else:
            add_contact(element, FINGER_FRICTION)


def add_actuator(robot: ET.Element, joint: str) -> None:
    """Declare a motor for a joint (icub-models' files have none)."""
    transmission = ET.SubElement(
        robot, "transmission", name=f"{joint}_transmission", type="SimpleTransmission"
    )
    ET.SubElement(transmission, "type").text = "transmission_interface/SimpleTransmission"
    actuator = ET.SubElement(transmission, "actuator", name=joint)
    ET.SubElement(actuator, "mechanicalReduction").text = "1"
    driven = ET.SubElement(transmission, "joint", name=joint)
    ET.SubElement(driven, "hardwareInterface").text = "EffortJointInterface"


def _add_joint(
    robot: ET.Element,
    kind: str,
    name: str,
    parent: str,
    child: str,
    *,
    origin: Point,
    axis: Point,
    upper: float,
    effort: float,
    velocity: float,
    damping: float,
) -> None:
    """A joint from 0 to `upper` with its motor (m and N, or rad and N m)."""
    joint = ET.SubElement(robot, "joint", name=name, type=kind)
    ET.SubElement(joint, "origin", xyz=text(origin), rpy="0 0 0")
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    ET.SubElement(joint, "axis", xyz=text(axis))
    limit = {"lower": "0", "upper": f"{upper:g}", "effort": f"{effort:g}", "velocity": f"{velocity:g}"}
    ET.SubElement(joint, "limit", limit)
    ET.SubElement(joint, "dynamics", damping=f"{damping:g}")
    add_actuator(robot, name)


def _add_link(robot: ET.Element, name: str, centre: Point, mass: float, moment: str) -> ET.Element:
    link = ET.SubElement(robot, "link", name=name)
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value=f"{mass:g}")
    ET.SubElement(inertial, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")
    return link


def add_palm(hand: ET.Element, side: str) -> None:
    """The palm to touch, the thumb, and what hides where the mesh's fingers were."""
    out = PALM_SIGN[side]
    rear, front, width, depth = PALM
    centre = ((rear + front) / 2, 0, -out * depth / 2)
    add_contact(
        add_box(hand, "collision", f"{side}_palm", centre, (front - rear, width, depth)), FINGER_FRICTION
    )
    for n, ((x0, y0, d0), (x1, y1, d1)) in enumerate(itertools.pairwise(THUMB)):
        color = _RUBBER if n == len(THUMB) - 2 else _SHELL
        _add_limb(
            hand, f"{side}_thumb_{n + 1}", (x0, y0, -out * d0), (x1, y1, -out * d1), THUMB_RADIUS, color
        )
    # Where the mesh's fingers were cut off, and where the pads' stems come out on the back.
    bar = (KNUCKLE[0] - 0.002, 0, -out * (KNUCKLE[1] + 0.002))
    add_box(hand, "visual", f"{side}_knuckles", bar, (0.016, width, 2 * FINGER_RADIUS + 0.004))
    (x, y, depth), size = HOUSING
    for tag in ("visual", "collision"):
        box = add_box(hand, tag, f"{side}_housing", (x, y, -out * depth), size, color=_SHELL)
    add_contact(box, FINGER_FRICTION)


def add_fingers(robot: ET.Element, side: str) -> None:
    """Four fingers that bend alike: one link per row of phalanges, a revolute joint each (0 straight, more
    is towards the palm)."""
    out = PALM_SIGN[side]
    parent, origin = f"{side}_hand_dh_frame", (KNUCKLE[0], 0.0, -out * KNUCKLE[1])
    rows = zip(phalanx_names(side), knuckle_names(side), PHALANGES, strict=True)
    for n, (name, joint, length) in enumerate(rows):
        link = _add_link(robot, name, (length / 2, 0, 0), 0.02, "6e-6")
        color = _RUBBER if n == len(PHALANGES) - 1 else _SHELL
        for finger, y in enumerate(FINGERS_AT):
            _add_limb(link, f"{name}_{finger}", (0, y, 0), (length, y, 0), FINGER_RADIUS, color)
        _add_joint(
            robot,
            "revolute",
            joint,
            parent,
            name,
            origin=origin,
            axis=(0, -out, 0),
            upper=MAX_BEND,
            effort=KNUCKLE_TORQUE,
            velocity=5.0,
            damping=0.01,
        )
        parent, origin = name, (length, 0.0, 0.0)


def _add_pad_spheres(link: ET.Element, name: str, outward: float, out: float) -> None:
    """Rows of small spheres on the inner face: point contact on flat faces alone would creep."""
    for row, above in enumerate(_PAD_ROWS):
        for column, across in enumerate(_PAD_COLUMNS):
            sphere = ET.SubElement(link, "collision", name=f"{name}_pad_{row}{column}")
            centre = (
                across,
                outward * PAD_RADIUS / 2,
                out * (FINGER_LENGTH - above),
            )
            ET.SubElement(sphere, "origin", xyz=text(centre), rpy="0 0 0")
            ET.SubElement(ET.SubElement(sphere, "geometry"), "sphere", radius=f"{PAD_RADIUS:g}")
            add_contact(sphere, FINGER_FRICTION)


def add_gripper(robot: ET.Element, side: str) -> None:
    """The carriage and both pads: links, prismatic joints (pads 0 closed .. `STROKE` open), motors."""
    out = PALM_SIGN[side]
    carriage = carriage_name(side)
    _add_link(robot, carriage, (FINGER_OFFSET, 0, 0), 0.04, "2e-5")
    _add_joint(
        robot,
        "prismatic",
        carriage,
        f"{side}_hand_dh_frame",
        carriage,
        origin=(0, 0, 0),
        axis=(0, 0, -out),
        upper=DRAWN_IN,
        effort=CARRIAGE_FORCE,
        velocity=0.5,
        damping=1.0,
    )
    for name, outward in zip(finger_names(side), (1.0, -1.0), strict=True):
        link = _add_link(robot, name, (0, 0, out * FINGER_LENGTH / 2), 0.04, "2e-5")
        middle = outward * FINGER_THICKNESS / 2
        body = (FINGER_WIDTH, FINGER_THICKNESS, FINGER_LENGTH)
        add_contact(
            add_box(link, "collision", f"{name}_box", (0, middle, out * FINGER_LENGTH / 2), body),
            FINGER_FRICTION,
        )
        _add_pad_spheres(link, name, outward, out)
        stem = FINGER_LENGTH * 0.45
        stem_size = (FINGER_WIDTH * 0.4, FINGER_THICKNESS * 0.8, stem)
        add_box(link, "visual", f"{name}_stem", (0, middle, out * stem / 2), stem_size)
        # The arm on which the pad slides out of the palm; one beside the other.
        arm = (outward * 0.004, outward * (FINGER_THICKNESS - ARM) / 2, out * 0.004)
        add_box(link, "visual", f"{name}_arm", arm, (0.007, ARM + FINGER_THICKNESS, 0.006))
        tip = FINGER_LENGTH - stem
        tip_centre = (0, middle, out * (stem + tip / 2))
        tip_size = (FINGER_WIDTH, FINGER_THICKNESS, tip)
        add_box(link, "visual", f"{name}_tip", tip_centre, tip_size, color=_RUBBER)
        _add_joint(
            robot,
            "prismatic",
            name,
            carriage,
            name,
            origin=(FINGER_OFFSET, 0, 0),
            axis=(0, outward, 0),
            upper=STROKE,
            effort=FINGER_FORCE,
            velocity=0.5,
            damping=1.0,
        )
