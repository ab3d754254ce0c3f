"""Fast checks of the physical side: the converted robot, shapes, kinematics, impossible requests."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pytest
from pydrake.math import RigidTransform, RollPitchYaw

from cognitive_arch.domain import Domain, ObjectSpec, load_domain
from cognitive_arch.errors import BackendError
from cognitive_arch.scenes import load_scene
from sim import rendering
from sim.assets import robot_urdf, roll_pitch_yaw, rotation
from sim.environment import DrakeEnvironment
from sim.kinematics import DOWN, HandTarget, Kinematics, fingertip, palm_axis
from sim.scenario import object_inertia
from sim.world import World


@pytest.fixture(scope="module")
def world(domain: Domain) -> World:
    scene = load_scene("simple")
    made = World(domain, scene)
    made.reset(dict(scene.objects))
    return made


@pytest.fixture(scope="module")
def kinematics(world: World) -> Kinematics:
    return Kinematics(world.joint_names, world.scene.table.height)


def test_conversion_is_complete_and_cached() -> None:
    urdf = robot_urdf()
    root = ET.parse(urdf).getroot()
    for mesh in root.iter("mesh"):
        assert (urdf.parent / str(mesh.get("filename"))).is_file()
    motors = {str(t.find("joint").get("name")) for t in root.findall("transmission")}  # type: ignore[union-attr]
    moving = {str(j.get("name")) for j in root.findall("joint") if j.get("type") != "fixed"}
    assert motors == moving
    # Torso, arms, and per hand two pads, their carriage and three rows of knuckles.
    assert len(moving) == 3 + 2 * 7 + 2 * 6
    stamp = urdf.stat().st_mtime_ns
    assert robot_urdf().stat().st_mtime_ns == stamp


def test_conversion_needs_a_writable_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", "/dev/null/cache")
    with pytest.raises(BackendError, match="cannot write the robot model cache"):
        robot_urdf()


def test_interrupted_conversion_leaves_no_cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))

    def stop(folder: Path) -> Path:
        (folder / "half.obj").write_text("v 0 0 0")
        raise KeyboardInterrupt

    with monkeypatch.context() as patched:
        patched.setattr("sim.assets.convert", stop)
        with pytest.raises(KeyboardInterrupt):
            robot_urdf()
    assert list((tmp_path / "cognitive_arch").iterdir()) == []
    assert robot_urdf().is_file()


def test_rotations_round_trip() -> None:
    for rpy in [(0.1, -0.4, 2.0), (0.0, 0.0, 0.0), (-1.0, 0.5, -3.0)]:
        assert roll_pitch_yaw(rotation(rpy)) == pytest.approx(rpy)


def test_inertia_is_that_of_the_solid(domain: Domain) -> None:
    bun = domain.objects["Bun-top"]
    inertia = object_inertia(bun)
    assert inertia.get_mass() == pytest.approx(bun.mass)
    assert inertia.CalcRotationalInertia().get_moments()[2] == pytest.approx(0.5 * bun.mass * 0.03**2)
    for name, spec in sorted(domain.objects.items()):
        assert object_inertia(spec).IsPhysicallyValid(), name
    rake = object_inertia(domain.objects["Rake"])
    assert rake.get_com()[0] < -0.03  # the bar at -x pulls the centre of mass there


def test_objects_lie_where_the_scene_says_and_stay(world: World) -> None:
    world.hold(1.0)
    for name, placement in world.scene.objects.items():
        p_WO = world.pose(name).translation()
        assert math.dist(p_WO[:2], placement.position) < 2e-4
        assert p_WO[2] - world.height(name) / 2 == pytest.approx(world.scene.table.height, abs=5e-4)
        assert ("table", name) in world.contacts()


def test_inverse_kinematics_meets_its_target(world: World, kinematics: Kinematics) -> None:
    for hand, y in (("LeftHand", -0.1), ("RightHand", 0.15)):
        target = HandTarget(fingertip(hand), np.array([-0.35, y, -0.08]), palm_axis(hand), DOWN, 0.1)
        joints = kinematics.solve(hand, target, world.home)
        assert joints is not None
        X_WH = kinematics.hand_pose(hand, joints)
        assert X_WH @ fingertip(hand) == pytest.approx(target.p_WP, abs=0.003)
        assert float((X_WH.rotation() @ palm_axis(hand)) @ DOWN) > math.cos(0.11)
        other = "r_" if hand == "LeftHand" else "l_"
        idle = [i for i, n in enumerate(world.joint_names) if n.startswith(other)]
        assert joints[idle] == pytest.approx(world.home[idle])


def test_reach_is_kinematic(kinematics: Kinematics) -> None:
    for hand in ("LeftHand", "RightHand"):
        assert kinematics.reaches(hand, -0.45, 0.0)
        assert kinematics.reaches(hand, -0.483, -0.068)
        assert not kinematics.reaches(hand, -0.72, 0.0)
    # Each arm reaches farther on its own side (left is y < 0).
    assert kinematics.reaches("LeftHand", -0.48, -0.22)
    assert not kinematics.reaches("RightHand", -0.48, -0.22)


def test_complex_scene_knows_what_is_out_of_reach(domain: Domain) -> None:
    environment = DrakeEnvironment(domain, load_scene("complex"))
    seen = {obj.name: obj for obj in environment.reset(0).objects}
    assert seen["Bun-top"].reachable_with == ("Rake", "Stick")
    assert seen["Bun-top"].pullable_with == ("Rake",)
    assert seen["Tomato"].pullable_with == ("Rake",)
    assert {"LeftHand", "RightHand"} <= set(seen["Bun-bottom"].reachable_with)


def test_missing_libegl_is_one_clear_line(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> None:
        raise OSError(name)

    monkeypatch.setattr("sim.rendering.ctypes.CDLL", missing)
    with pytest.raises(BackendError, match="apt-get install libegl1"):
        rendering.check_rendering()


def test_too_wide_to_grasp(domain: Domain) -> None:
    wide = ObjectSpec.model_validate(
        {"shape": {"type": "box", "size": [0.2, 0.2, 0.01]}, "mass": 0.1, "color": [1, 0, 0]}
    )
    bigger = domain.model_copy(update={"objects": {**domain.objects, "Ham": wide}})
    environment = DrakeEnvironment(bigger, load_scene("simple"), perception="oracle")
    environment.reset(0)
    from tests.conftest import action

    assert str(environment.execute(action("graspWith(Ham,LeftHand)")).reason) == "too_wide"


@pytest.mark.parametrize("roll", [math.pi, math.pi - 0.15])
@pytest.mark.parametrize("name", ["simple", "toys"])
def test_what_was_turned_over_lies_on_the_table_and_not_in_it(name: str, roll: float) -> None:
    scene = load_scene(name)
    domain = load_domain(scene.domain)
    flat = [n for n in scene.objects if domain.objects[n].shape.type in ("box", "cylinder")]
    world = World(domain, scene)
    world.reset(dict(scene.objects))
    tops = {n: scene.table.height + world.height(n) / 2 for n in flat}
    for i, thing in enumerate(flat):
        place = [-0.65, -0.4 + 0.2 * i, tops[thing] + 0.01]
        world.place(thing, RigidTransform(RollPitchYaw(roll, 0.0, 0.0), place))
    world.hold(0.8)
    for thing in flat:
        pose = world.pose(thing)
        assert pose.rotation().matrix()[2, 2] < -0.99
        assert pose.translation()[2] == pytest.approx(tops[thing], abs=0.001)
