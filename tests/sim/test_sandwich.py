"""Long physics tests: what the robot claims is read off contacts and poses."""

from __future__ import annotations

import hashlib
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from PIL import Image
from pydrake.math import RigidTransform

from cognitive_arch.domain import Domain
from cognitive_arch.errors import StoreError
from cognitive_arch.execution.environment import FailureReason, Outcome
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.runlog.trajectory import Trajectory
from cognitive_arch.runs import resume_task, run_task
from cognitive_arch.scenes import load_scene
from cognitive_arch.session import Progress, RunConfig
from sim.environment import DrakeEnvironment
from sim.pictures import Stage, write_video
from sim.trials import HAND_PAIRS, attempt, sandwich, stacked
from tests.conftest import action
from tests.sim.physics import check_physics

pytestmark = pytest.mark.physics


@pytest.fixture(scope="module")
def simple(domain: Domain) -> DrakeEnvironment:
    return DrakeEnvironment(domain, load_scene("simple"), jitter=0.02)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("hands", sorted(HAND_PAIRS))
def test_sandwich_on_jittered_scenes(simple: DrakeEnvironment, hands: str, seed: int) -> None:
    ok, reasons = attempt(simple, seed, HAND_PAIRS[hands])
    assert ok, reasons
    table = simple.world.scene.table.height
    heights = [simple.world.pose(n).translation()[2] - table for n in ("Bun-bottom", "Ham", "Bun-top")]
    assert heights == pytest.approx([0.010, 0.025, 0.040], abs=0.002)
    up = simple.world.pose("Bun-top").rotation().matrix()[2, 2]
    assert up > np.cos(0.05)


def test_objects_are_held_by_friction_alone(domain: Domain) -> None:
    """Without friction nothing can be lifted: no joint or constraint ties an object to a hand."""
    slippery = DrakeEnvironment(domain, load_scene("simple"), friction=0.0)
    slippery.reset(0)
    result = slippery.execute(action("graspWith(Ham,LeftHand)"))
    assert (result.outcome, result.reason) == (Outcome.FAILURE, FailureReason.NOT_GRASPED)
    assert slippery.world.plant.num_constraints() == 0


def test_a_held_object_is_squeezed_and_lifted(simple: DrakeEnvironment) -> None:
    simple.reset(3)
    result = simple.execute(action("graspWith(Ham,RightHand)"))
    assert result.outcome is Outcome.SUCCESS
    assert result.effect["displacement_z"] > 0.08
    assert 1.0 < result.effect["contact_duration"] < result.effect["duration"]
    assert result.effect["object_contact_duration"] == 0.0
    contacts = simple.world.contacts()
    assert {("Ham", "r_finger_a"), ("Ham", "r_finger_b")} <= contacts
    assert ("Ham", "table") not in contacts
    simple.settle(2.0)
    assert simple.robot.perception.held("RightHand") == "Ham"


def test_taking_the_sandwich_apart(simple: DrakeEnvironment) -> None:
    """From the top of the stack, with the other hand; a covered object is refused."""
    simple.reset(4)
    for step in sandwich("LeftHand", "RightHand"):
        assert simple.execute(step).outcome is Outcome.SUCCESS
    assert simple.execute(action("graspWith(Ham,LeftHand)")).reason is FailureReason.COVERED
    for call in ("graspWith(Bun-top,LeftHand)", "dropWith(Bun-top,LeftHand)", "graspWith(Ham,RightHand)"):
        assert simple.execute(action(call)).outcome is Outcome.SUCCESS, call
    assert not stacked(simple)


def test_both_hands_full(simple: DrakeEnvironment) -> None:
    simple.reset(5)
    for call in ("graspWith(Ham,LeftHand)", "graspWith(Bun-top,RightHand)"):
        assert simple.execute(action(call)).outcome is Outcome.SUCCESS, call
    assert [h.holding for h in simple.observe().hands] == ["Ham", "Bun-top"]
    refused = simple.execute(action("putOnWith(Ham,Bun-top,LeftHand)"))
    assert refused.reason is FailureReason.HAND_BUSY
    for call in ("putOnWith(Ham,Bun-bottom,LeftHand)", "putOnWith(Bun-top,Ham,RightHand)"):
        assert simple.execute(action(call)).outcome is Outcome.SUCCESS, call
    assert stacked(simple)


def test_a_hand_that_lost_its_object_is_free_again(simple: DrakeEnvironment) -> None:
    simple.reset(2)
    assert simple.execute(action("graspWith(Ham,LeftHand)")).outcome is Outcome.SUCCESS
    world = simple.world
    plant = world.plant
    place = RigidTransform([-0.35, 0.2, world.scene.table.height + 0.006])
    context = plant.GetMyMutableContextFromRoot(world.simulator.get_mutable_context())
    plant.SetFreeBodyPose(context, world.scenario.objects["Ham"], place)
    simple.settle(0.2)
    assert [hand.holding for hand in simple.observe().hands] == [None, None]
    assert simple.execute(action("graspWith(Bun-top,LeftHand)")).outcome is Outcome.SUCCESS
    assert sorted(simple.robot.grips) == ["LeftHand"]
    assert simple.execute(action("graspWith(Ham,RightHand)")).outcome is Outcome.SUCCESS


DIGEST = """
import hashlib, json, sys
from pathlib import Path
from cognitive_arch.runlog.trajectory import Trajectory
from cognitive_arch.runs import resume_task, run_task
from cognitive_arch.session import Progress, RunConfig
from cognitive_arch.execution.noise import NoiseLevels
from cognitive_arch.runlog.store import RunStore
folder = Path(sys.argv[1])
config = RunConfig(seed=8, jitter=0.02, noise=NoiseLevels(left=0.4), record=False)
run_task("make a ham sandwich", config, folder)
with RunStore(folder) as store:
    run = store.runs()[-1]
    steps = store.steps(run.run_id)
    worlds = [store.worlds.get(run.run_id, v).to_json() for v in store.worlds.versions(run.run_id)]
print(hashlib.sha256(json.dumps([steps, worlds], sort_keys=True).encode()).hexdigest(), len(steps))
"""


def test_same_seed_same_run_in_two_processes(tmp_path: Path) -> None:
    """To the last logged number, with other hash seeds: poses, plans, values, outcomes."""
    digests = []
    for name in ("1", "2"):
        command = [sys.executable, "-c", DIGEST, str(tmp_path / name)]
        env = os.environ | {"PYTHONHASHSEED": name}
        done = subprocess.run(command, capture_output=True, text=True, check=True, env=env)
        digests.append(done.stdout)
    assert digests[0] == digests[1]
    assert int(digests[0].split()[1]) >= 4
    assert len(digests[0].split()[0]) == hashlib.sha256().digest_size * 2


@pytest.mark.parametrize("seed", [6, 7])
def test_from_a_sentence_to_a_sandwich(tmp_path: Path, seed: int) -> None:
    result = run_task("make a ham sandwich", RunConfig(seed=seed, jitter=0.02, record=False), tmp_path)
    assert result["success"]
    assert {"on(Ham,Bun-bottom)", "on(Bun-top,Ham)"} <= set(result["final_state"])


def test_noise_makes_an_arm_miss_and_the_robot_finds_another_way(tmp_path: Path) -> None:
    config = RunConfig(seed=1, noise=NoiseLevels(left=1.0), record=False)
    result = run_task("make a ham sandwich", config, tmp_path)
    assert result["success"]
    failed = [a for a in result["actions"] if a["outcome"] == "failure"]
    assert failed
    assert {a["reason"] for a in failed} <= {
        "not_grasped", "slipped", "misplaced", "out_of_reach", "blocked", "unexpected_effect", "no_effect",
    }  # fmt: skip


STEPS = [f"step-{n:02}-{view}.png" for n in range(1, 5) for view in ("eye", "side")]


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """A recorded run that was killed when it had decided on its third action, and gone on with."""

    class Killed(BaseException):
        pass

    actions: list[object] = []

    def on_act(action: object) -> None:
        actions.append(action)
        if len(actions) == 3:
            raise Killed

    folder = tmp_path_factory.mktemp("recorded")
    with pytest.raises(Killed):
        run_task("make a ham sandwich", RunConfig(), folder, Progress(on_act=on_act))
    (run,) = folder.glob("*-drake-0")
    left = {path.name for path in run.iterdir() if not path.name.startswith(".")}
    assert left == {*STEPS[:4], "start.png", "trajectory.npz"}
    return run, resume_task("latest", folder)


def test_a_recorded_run_leaves_pictures_and_one_html_file(recorded: tuple[Path, dict[str, Any]]) -> None:
    _, result = recorded
    assert result["success"]
    files = {Path(p).name: Path(p) for p in result["artifacts"]}
    assert set(files) == {"start.png", "end.png", *STEPS, "recording.html", "trajectory.npz"}
    images = {name: np.asarray(Image.open(files[name]), float) for name in ("start.png", "end.png", *STEPS)}
    for name, image in images.items():
        assert image.std() > 20, name  # not a blank picture
    for one, other in (("start.png", "end.png"), (STEPS[0], STEPS[2]), (STEPS[1], STEPS[5])):
        assert np.abs(images[one] - images[other]).max() > 50  # something has moved
    html = files["recording.html"].read_text(encoding="utf-8")
    assert 1e6 < len(html) < 15e6
    assert "<script src=" not in html


def test_a_resumed_runs_trajectory_is_whole_and_sound(recorded: tuple[Path, dict[str, Any]]) -> None:
    """Nothing sinks into anything, joints stay in their limits, no sample is missing or there twice."""
    path = recorded[0] / "trajectory.npz"
    trajectory = Trajectory.load(path)
    check_physics(trajectory)
    assert path.stat().st_size < 1e6 * trajectory.time[-1] / 60
    gaps = np.diff(trajectory.time)
    assert gaps.min() > 0
    assert gaps.max() < 0.09
    assert trajectory.time[0] < 0.09
    assert set(trajectory.labels) == {
        "",
        *(f"{a['action']}({','.join(a['args'])})" for a in recorded[1]["actions"]),
    }
    ham = trajectory.object_names.index("Ham")
    assert trajectory.poses[:, ham, 2].max() - trajectory.poses[0, ham, 2] > 0.08  # it was lifted
    assert trajectory.deepest({"Ham"}, {"l_finger_a", "r_finger_a"}) > 0.0002  # and squeezed


def test_a_video_is_made_afterwards(
    cogarch: Any, domain: Domain, recorded: tuple[Path, dict[str, Any]], tmp_path: Path
) -> None:
    store, file = tmp_path / "runs", tmp_path / "video.mp4"
    shutil.copytree(recorded[0].parent, store)
    path = store / recorded[0].name / "trajectory.npz"
    trajectory = Trajectory.load(path).until(4.0)
    trajectory.save(path)
    answer = cogarch("inspect", "latest", "--video", str(file), "--json")
    assert answer.json == {"run_id": recorded[1]["run_id"], "video": str(file)}
    video = cv2.VideoCapture(str(file))
    frames = []
    while True:
        ok, frame = video.read()
        if not ok:
            break
        frames.append(frame.astype(float))
    assert video.get(cv2.CAP_PROP_FPS) == 12.5
    assert abs(len(frames) / 12.5 - 4.0) < 0.15
    assert {frame.shape for frame in frames} == {(480, 640, 3)}
    assert np.abs(frames[-1] - frames[0]).mean() > 1  # the arm moves
    corner = [frame[440:475, 10:300] for frame in (frames[0], frames[-1])]
    assert np.abs(corner[1] - corner[0]).mean() > 5  # the action's name appears
    with pytest.raises(StoreError, match="cannot write the video"):
        write_video(Stage(domain, load_scene("simple")), trajectory, tmp_path / "nowhere" / "video.mp4")
    with pytest.raises(StoreError, match="the scene has"):
        write_video(Stage(domain, load_scene("kitchen")), trajectory, tmp_path / "other.mp4")
