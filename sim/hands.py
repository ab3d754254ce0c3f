"""The grippers we add to the iCub's palms, written as URDF elements.

icub-models has no movable fingers on its full robots, so each palm carries two prismatic finger pads
that close on each other. The hand frame is the robot's own `[lr]_hand_dh_frame`: x runs along the
fingers, z through the palm (out of it on the right hand, into it on the left one).
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Sequence

DRAKE = "{http://drake.mit.edu}"

SIDES: dict[str, str] = {"LeftHand": "l", "RightHand": "r"}
PALM_SIGN: dict[str, float] = {"l": -1.0, "r": 1.0}
"""Which way the palm faces along z of the hand frame."""

FINGER_LENGTH = 0.055  # m, from the palm to the tip
FINGER_WIDTH = 0.042  # m, along x of the hand
FINGER_THICKNESS = 0.008  # m, along y of the hand
FINGER_OFFSET = 0.020  # m, of the pads in front of the hand frame
STROKE = 0.050  # m, travel of one finger from the middle
FINGER_FORCE = 10.0  # N, at most
PAD_RADIUS = 0.002  # m, of the small spheres that carry contact
PAD_STIFFNESS = 5.0e4  # N/m
FINGER_FRICTION = 1.0
HANDLE = (0.030, 0.050, 0.080, 0.110)  # m from a tool's end, where it may be held, best first

# Metres above the tip and across the finger. Two columns cradle a round slice: a single middle one would
# hold it in two points, off which it creeps as soon as it is not met exactly in its diameter. Three rows
# meet even a slice of 10 mm in two, so that it cannot swing about the line between the fingers. The outer
# columns are for tools, which would else turn in the hand by half a degree per second.
_PAD_ROWS = (0.0025, 0.0055, 0.0085, 0.016, 0.030, 0.045)
_PAD_COLUMNS = (-0.018, -0.010, 0.010, 0.018)
_RUBBER = "0.13 0.14 0.16 1"
_METAL = "0.62 0.64 0.68 1"


def finger_names(side: str) -> tuple[str, str]:
    """The two finger links (and joints) of side `l` or `r`."""
    return (f"{side}_finger_a", f"{side}_finger_b")


def text(values: Sequence[float]) -> str:
    """Numbers as URDF wants them."""
    return " ".join(f"{v:.9g}" for v in values)


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
        material = ET.SubElement(element, "material", name=f"{name}_material")
        ET.SubElement(material, "color", rgba=color)
    return element


def add_contact(collision: ET.Element, friction: float) -> None:
    """Give a collision element its friction coefficient and stiffness."""
    properties = ET.SubElement(collision, f"{DRAKE}proximity_properties")
    for key in ("mu_static", "mu_dynamic"):
        ET.SubElement(properties, f"{DRAKE}{key}", value=f"{friction:g}")
    ET.SubElement(properties, f"{DRAKE}point_contact_stiffness", value=f"{PAD_STIFFNESS:g}")


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


def add_palm(hand: ET.Element, side: str) -> None:
    """Collision boxes for the palm and the rigid fingers, and a visible rail for the pads to run on."""
    out = PALM_SIGN[side]
    for part, x, depth, size in (
        ("palm", -0.02, 0.015, (0.08, 0.06, 0.030)),
        ("fingers", 0.058, 0.010, (0.076, 0.06, 0.018)),
    ):
        box = add_box(hand, "collision", f"{side}_{part}", (x, 0, -out * depth), size)
        add_contact(box, FINGER_FRICTION)
    rail = (0.022, 2 * (STROKE + FINGER_THICKNESS), 0.010)
    add_box(hand, "visual", f"{side}_rail", (FINGER_OFFSET, 0, -out * 0.004), rail)


def _add_inertial(link: ET.Element, centre: Sequence[float]) -> None:
    inertial = ET.SubElement(link, "inertial")
    ET.SubElement(inertial, "origin", xyz=text(centre), rpy="0 0 0")
    ET.SubElement(inertial, "mass", value="0.04")
    moment = "2e-5"
    ET.SubElement(inertial, "inertia", ixx=moment, iyy=moment, izz=moment, ixy="0", ixz="0", iyz="0")


def _add_pads(link: ET.Element, name: str, outward: float, out: float) -> None:
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


def add_fingers(robot: ET.Element, side: str) -> None:
    """Add both finger pads of a hand: links, prismatic joints (0 closed .. `STROKE` open), motors."""
    out = PALM_SIGN[side]
    for name, outward in zip(finger_names(side), (1.0, -1.0), strict=True):
        link = ET.SubElement(robot, "link", name=name)
        _add_inertial(link, (0, 0, out * FINGER_LENGTH / 2))
        middle = outward * FINGER_THICKNESS / 2
        body = (FINGER_WIDTH, FINGER_THICKNESS, FINGER_LENGTH)
        add_contact(
            add_box(link, "collision", f"{name}_box", (0, middle, out * FINGER_LENGTH / 2), body),
            FINGER_FRICTION,
        )
        _add_pads(link, name, outward, out)
        stem = FINGER_LENGTH * 0.45
        stem_size = (FINGER_WIDTH * 0.6, FINGER_THICKNESS * 0.8, stem)
        add_box(link, "visual", f"{name}_stem", (0, middle, out * stem / 2), stem_size)
        tip = FINGER_LENGTH - stem
        tip_centre = (0, middle, out * (stem + tip / 2))
        tip_size = (FINGER_WIDTH, FINGER_THICKNESS, tip)
        add_box(link, "visual", f"{name}_tip", tip_centre, tip_size, color=_RUBBER)
        joint = ET.SubElement(robot, "joint", name=name, type="prismatic")
        ET.SubElement(joint, "origin", xyz=text((FINGER_OFFSET, 0, 0)), rpy="0 0 0")
        ET.SubElement(joint, "parent", link=f"{side}_hand_dh_frame")
        ET.SubElement(joint, "child", link=name)
        ET.SubElement(joint, "axis", xyz=text((0, outward, 0)))
        limit = {"lower": "0", "upper": f"{STROKE:g}", "effort": f"{FINGER_FORCE:g}", "velocity": "0.5"}
        ET.SubElement(joint, "limit", limit)
        ET.SubElement(joint, "dynamics", damping="1.0")
        add_actuator(robot, name)
