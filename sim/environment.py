"""The Drake environment: the `Environment` protocol on physics."""

from __future__ import annotations

import gc
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from cognitive_arch.domain import Domain, Scene, jittered
from cognitive_arch.errors import StoreError
from cognitive_arch.execution.environment import FailureReason, Outcome, SkillResult
from cognitive_arch.execution.saving import SavedState, restore_rng, restoring, save_rng
from cognitive_arch.outside import OutsideEvent
from cognitive_arch.perception.recognition import load_recogniser
from cognitive_arch.relational.symbols import GroundAction
from cognitive_arch.runlog.trajectory import TRAJECTORY, Trajectory
from cognitive_arch.world.observation import Observation
from sim.clearance import Clearance
from sim.eyes import IDEAL, SENSOR, EyeNoise, Eyes
from sim.hands import Posture
from sim.kinematics import Kinematics
from sim.meddling import disturb
from sim.noise import EpisodeNoise, PhysicalNoise
from sim.perception import OraclePerception, Perception
from sim.pictures import LARGE, SMALL, Stage, View, save_picture, write_recording, write_video
from sim.recorder import Recorder
from sim.robot import Robot
from sim.scenario import FRICTION
from sim.sight import CameraPerception
from sim.skills import SKILLS
from sim.skills.base import let_go_of_lost, unusable_arguments
from sim.world import World

SETTLE = 0.3  # s before the first look
FORMAT = 3  # of saved states
ARTIFACTS = (".png", ".npz", ".html", ".mp4")


class DrakeEnvironment:
    """A simulated iCub at a table; see `Environment`.

    `noise` maps `left`, `right`, `pull` and `push` to noise levels, or is a composition of its own.
    `record` makes pictures, a trajectory and a Meshcat recording of an episode, with `video` a video, too.
    `reach` is `kinematic`, or `published` for the constants of the scene. `perception` is one of
    `PERCEPTIONS`; the eyes' sensors have `eye_noise` where that is given, and things cast `shadows` or not.
    """

    skills = frozenset(SKILLS)

    def __init__(
        self,
        domain: Domain,
        scene: Scene,
        *,
        noise: Mapping[str, float] | PhysicalNoise | None = None,
        jitter: float = 0.0,
        record: bool = False,
        video: bool = False,
        friction: float = FRICTION,
        reach: str = "kinematic",
        perception: str = "camera",
        eye_noise: EyeNoise | None = None,
        shadows: bool = False,
    ) -> None:
        self._domain = domain
        self._scene = scene
        self._noise = noise if isinstance(noise, PhysicalNoise) else PhysicalNoise(dict(noise or {}))
        self.noise_told = self._noise.told()
        self._jitter = jitter
        self._reach = scene.reach if reach == "published" else None
        self.world = World(domain, scene, friction=friction)
        self._kinematics = Kinematics(self.world.joint_names, scene.table.height)
        self._clearance = Clearance(self.world)
        self.recorder = Recorder(self.world, keep=record)
        self._stage = Stage(domain, scene) if record else None
        self._video = video
        self._eyes, self._classify = None, None
        if perception != "oracle":
            noise_of_eyes = eye_noise or (SENSOR if perception == "noisy-camera" else IDEAL)
            self._eyes = Eyes(domain, scene, shadows=shadows, noise=noise_of_eyes)
            self._classify = load_recogniser(domain.name).classify
        self._robot: Robot | None = None
        self._folder: Path | None = None

    @property
    def robot(self) -> Robot:
        """The robot of the current episode; raises `RuntimeError` before the first reset."""
        if self._robot is None:
            raise RuntimeError("reset the environment first")
        return self._robot

    def reset(self, seed: int) -> Observation:
        """See `Environment.reset`."""
        rng = np.random.default_rng(seed)
        self.world.reset(jittered(self._scene, self._jitter, rng, self._domain))
        self.recorder.restart()
        self._robot = self._new_robot(rng, seed)
        self._robot.noise.begin()
        self.world.hold(SETTLE)
        return self.observe()

    def _new_robot(self, rng: np.random.Generator, seed: int = 0) -> Robot:
        noise = EpisodeNoise(self._noise, self.world, rng)
        truth = OraclePerception(self.world, self._kinematics, self._reach)
        perception: Perception = truth
        if self._eyes is not None and self._classify is not None:
            perception = CameraPerception(
                self.world, self._kinematics, self._reach, self._eyes, self._classify, seed
            )
        return Robot(
            self._domain,
            self._scene,
            self.world,
            noise,
            rng,
            self._kinematics,
            self._clearance,
            perception=perception,
            truth=truth,
        )

    def observe(self) -> Observation:
        """See `Environment.observe`."""
        return self.robot.perception.observe()

    def truth(self) -> Observation | None:
        """See `Environment.truth`."""
        return None if self.robot.perception is self.robot.truth else self.robot.truth.observe()

    def execute(self, action: GroundAction) -> SkillResult:
        """See `Environment.execute`."""
        entry = SKILLS.get(action.name)
        if entry is None:
            return SkillResult(Outcome.FAILURE, FailureReason.UNKNOWN_SKILL)
        perform = entry.form_for(action)
        wrong = unusable_arguments(self.robot, action) if perform else FailureReason.UNKNOWN_OBJECT
        if perform is None or wrong is not None:
            return SkillResult(Outcome.FAILURE, wrong or FailureReason.UNKNOWN_OBJECT)
        let_go_of_lost(self.robot)
        started, name = self.world.time, action.args[0]
        perception = self.robot.perception
        before = perception.pose(name).translation()
        hand = action.args[-1]
        held = perception.held(hand)
        self.recorder.begin(str(action))
        self.robot.measured.clear()
        reason = perform(self.robot, action.args)
        effect = {"duration": self.world.time - started}
        perception.look()
        if name in perception.names():
            moved = perception.pose(name).translation() - before
            effect |= {f"displacement_{axis}": float(d) for axis, d in zip("xyz", moved, strict=True)}
        effect |= self.recorder.measured(hand, held, name) | self.robot.measured
        self.recorder.begin()
        outcome = Outcome.SUCCESS if reason is FailureReason.NONE else Outcome.FAILURE
        return SkillResult(outcome, reason, effect)

    def set_posture(self, hand: str, posture: Posture) -> None:
        """Straight, bent or arched fingers for one hand; raises `ValueError` if it holds something."""
        self.robot.set_posture(hand, posture)

    def disturb(self, event: OutsideEvent) -> tuple[str, ...]:
        """See `Environment.disturb`."""
        return disturb(self.robot, event)

    def settle(self, seconds: float) -> None:
        """See `Environment.settle`."""
        self.world.hold(seconds)

    def save(self) -> SavedState:
        """See `Environment.save`."""
        robot = self.robot.save() | {"rng": save_rng(self.robot.rng)}
        return {"kind": "drake", "format": FORMAT, "world": self.world.save(), "robot": robot}

    def restore(self, saved: SavedState) -> Observation:
        """See `Environment.restore`."""
        with restoring(saved, "drake", FORMAT):
            rng = restore_rng(saved["robot"]["rng"])
            robot = self._new_robot(rng)
            robot.restore(saved["robot"])
            self.world.restore(saved["world"])
            robot.noise.take_effect()
        self._robot = robot
        self.recorder.restart(self._earlier())
        return self.observe()

    def _earlier(self) -> Trajectory | None:
        """What was recorded of the episode before now, by another process; nothing if that is damaged, for
        a run can go on without."""
        path = None if self._folder is None else self._folder / TRAJECTORY
        try:
            return Trajectory.load(path).until(self.world.time) if path and path.exists() else None
        except StoreError:
            return None

    def record_into(self, folder: Path) -> None:
        """See `Environment.record_into`: `start.png` at once."""
        if self._stage is None:
            return
        self._folder = folder
        self._take(folder / "start.png", View.SIDE, LARGE)

    def keep_step(self, number: int) -> None:
        """See `Environment.keep_step`: two pictures of the step, and the trajectory so far."""
        if self._folder is None:
            return
        self._take(self._folder / f"step-{number:02}-{View.SIDE}.png", View.SIDE)
        eye = self._folder / f"step-{number:02}-{View.EYE}.png"
        picture = self.robot.perception.picture()
        if picture is None:
            self._take(eye, View.EYE)
        else:
            save_picture(picture, eye)
        self.recorder.trajectory().save(self._folder / TRAJECTORY)

    def save_artifacts(self) -> tuple[str, ...]:
        """See `Environment.save_artifacts`: `end.png`, `recording.html` and perhaps `video.mp4`."""
        if self._stage is None or self._folder is None:
            return ()
        self._take(self._folder / "end.png", View.SIDE, LARGE)
        trajectory = self.recorder.trajectory()
        trajectory.save(self._folder / TRAJECTORY)
        write_recording(self._domain, self._scene, trajectory, self._folder / "recording.html")
        if self._video:
            write_video(self._stage, trajectory, self._folder / "video.mp4")
        return tuple(sorted(path.name for path in self._folder.iterdir() if path.suffix in ARTIFACTS))

    def _take(self, path: Path, view: View, size: tuple[int, int] = SMALL) -> None:
        assert self._stage is not None
        self._stage.show(self.world.positions())
        save_picture(self._stage.picture(view, size), path)

    def close(self) -> None:
        """See `Environment.close`."""
        self._robot = self._stage = self._eyes = None
        # Renderers and plants are few objects of many megabytes: the collector would wait too long.
        gc.collect()
