"""Records what moves: a sample per command tick, measured numbers of an action, the run's trajectory."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from pydrake.multibody.tree import BodyIndex

from cognitive_arch.runlog.trajectory import Trajectory
from sim.hands import SIDES, hand_links
from sim.world import Joints, World

KEEP_EVERY = 4  # ticks: 12.5 samples per second
AT_REST = 0.002  # m/s
Pair = tuple[str, str]


@dataclass(frozen=True, slots=True)
class Tick:
    """One moment of the simulation.

    `positions` are all of the plant's; `speeds` those of hands and objects, m/s; `depths` says how deep
    bodies that press on each other overlap, m.
    """

    time: float
    positions: Joints
    command: Joints
    speeds: Mapping[str, float]
    depths: Mapping[Pair, float]
    age: int  # ticks since `depths` were read
    label: str


@dataclass(frozen=True, slots=True)
class Sample:
    """What is kept of a few ticks: the last one's positions, and the worst of all of them."""

    time: float
    joints: NDArray[np.floating]
    command: NDArray[np.floating]
    beyond: NDArray[np.floating]
    poses: NDArray[np.floating]
    depths: Mapping[Pair, float]
    label: str


class Recorder:
    """Listens to a world. With `keep`, what it heard is thinned and kept as the episode's trajectory."""

    def __init__(self, world: World, *, keep: bool) -> None:
        self._world = world
        self.keep = keep
        plant, objects = world.plant, world.scenario.objects
        self._context = plant.GetMyContextFromRoot(world.simulator.get_context())
        self._contacts = plant.get_contact_results_output_port()
        self._bodies = [plant.get_body(BodyIndex(i)).name() for i in range(plant.num_bodies())]
        self._hands = {hand: plant.GetBodyByName(f"{side}_hand_dh_frame") for hand, side in SIDES.items()}
        joints = [plant.GetJointByName(name) for name in world.joint_names]
        self._joints = np.array([joint.position_start() for joint in joints])
        self._limits = np.array(
            [(j.position_lower_limits()[0], j.position_upper_limits()[0]) for j in joints]
        )
        self._objects = {name: objects[name].floating_positions_start() for name in sorted(objects)}
        self._n_positions = plant.num_positions()
        translation = self._n_positions + 3  # a free body's velocities are its rotation, then this
        self._velocities = {
            name: translation + body.floating_velocities_start_in_v() for name, body in objects.items()
        }
        self._ticks: list[Tick] = []
        self._samples: list[Sample] = []
        self._label = ""
        world.on_tick = self._tick

    def begin(self, label: str = "") -> None:
        """What follows is called `label`; measuring starts here."""
        if self.keep:
            self._samples += [self._sample(self._ticks[i : i + KEEP_EVERY]) for i in self._starts()]
        self._ticks.clear()
        self._label = label

    def restart(self, earlier: Trajectory | None = None) -> None:
        """Forget everything, but for what went before if an episode is taken up again."""
        self._ticks.clear()
        self._samples = [] if earlier is None else list(_samples(earlier))

    def _starts(self) -> range:
        return range(0, len(self._ticks), KEEP_EVERY)

    def _tick(self) -> None:
        context, world = self._context, self._world
        state = world.plant.GetPositionsAndVelocities(context)
        speeds = {name: _length(state[i : i + 3]) for name, i in self._velocities.items()}
        for hand, body in self._hands.items():
            speeds[hand] = _length(body.EvalSpatialVelocityInWorld(context).translational())
        # Reading contacts costs the most, so every third tick makes do, and fewer while nothing moves.
        wait = 2 if max(speeds.values()) > AT_REST else KEEP_EVERY - 1
        old = len(self._ticks) >= 1 and self._ticks[-1].age < wait
        self._ticks.append(
            Tick(
                world.time,
                state[: self._n_positions],
                world.set_point,
                speeds,
                self._ticks[-1].depths if old else self._read_depths(),
                self._ticks[-1].age + 1 if old else 0,
                self._label,
            )
        )

    def _read_depths(self) -> dict[Pair, float]:
        results = self._contacts.Eval(self._context)
        depths: dict[tuple[int, int], float] = {}
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair, depth = (int(info.bodyA_index()), int(info.bodyB_index())), info.point_pair().depth
            if depth > depths.get(pair, 0.0):
                depths[pair] = depth
        return {_ordered(self._bodies[a], self._bodies[b]): depth for (a, b), depth in depths.items()}

    # -- what came of it ----------------------------------------------------------------------------

    def measured(self, hand: str, held: str | None, name: str) -> dict[str, float]:
        """Numbers of the action since `begin`: see `SkillResult.effect`.

        `held` is what `hand` works with (a tool), `name` the object worked on.
        """
        links = hand_links(SIDES[hand])
        manipulator = (links | {held} if held else links) - {name}
        others = set(self._objects) - manipulator - {name}
        speeds = [tick.speeds for tick in self._ticks]
        return {
            "contact_duration": self._in_contact(name, manipulator),
            "object_contact_duration": self._in_contact(name, others),
            "hand_speed": max((s[hand] for s in speeds), default=0.0),
            "object_speed": max((s[name] for s in speeds), default=0.0),
        }

    def _in_contact(self, name: str, others: Collection[str]) -> float:
        """Seconds for which `name` touched one of the others."""
        seconds = 0.0
        for before, tick in pairwise(self._ticks):
            if any((a == name and b in others) or (b == name and a in others) for a, b in tick.depths):
                seconds += tick.time - before.time
        return seconds

    def _sample(self, ticks: Sequence[Tick]) -> Sample:
        joints = np.array([tick.positions[self._joints] for tick in ticks])
        beyond = np.maximum(self._limits[:, 0] - joints, joints - self._limits[:, 1])
        last, depths = ticks[-1], dict(ticks[-1].depths)
        for tick in ticks[:-1]:
            for pair, depth in tick.depths.items():
                depths[pair] = max(depth, depths.get(pair, 0.0))
        return Sample(
            last.time,
            joints[-1],
            last.command,
            np.maximum(beyond, 0.0).max(axis=0),
            np.array([self._pose(last.positions, start) for start in self._objects.values()]),
            depths,
            last.label,
        )

    @staticmethod
    def _pose(positions: Joints, start: int) -> Joints:
        """x, y, z and unit quaternion; the plant has the quaternion first, and lets its length drift."""
        quaternion = positions[start : start + 4]
        return np.concatenate([positions[start + 4 : start + 7], quaternion / np.linalg.norm(quaternion)])

    def trajectory(self) -> Trajectory:
        """All that was kept."""
        self.begin(self._label)
        samples = self._samples
        pairs = sorted({pair for sample in samples for pair in sample.depths})
        labels = sorted({sample.label for sample in samples})
        n, m, k = len(samples), len(self._joints), len(self._objects)
        return Trajectory(
            time=np.array([s.time for s in samples]),
            joint_names=self._world.joint_names,
            limits=self._limits,
            joints=np.array([s.joints for s in samples]).reshape(n, m),
            commands=np.array([s.command for s in samples]).reshape(n, m),
            beyond=np.array([s.beyond for s in samples]).reshape(n, m),
            object_names=tuple(self._objects),
            poses=np.array([s.poses for s in samples]).reshape(n, k, 7),
            pairs=tuple(pairs),
            depths=np.array([[s.depths.get(pair, 0.0) for pair in pairs] for s in samples]).reshape(n, -1),
            labels=tuple(labels),
            label=np.array([labels.index(s.label) for s in samples], dtype=np.int32),
        )


def _length(vector: Joints) -> float:
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)


def _ordered(a: str, b: str) -> Pair:
    return (a, b) if a < b else (b, a)


def _samples(trajectory: Trajectory) -> Iterable[Sample]:
    for i, time in enumerate(trajectory.time):
        depths = zip(trajectory.pairs, trajectory.depths[i], strict=True)
        yield Sample(
            float(time),
            trajectory.joints[i],
            trajectory.commands[i],
            trajectory.beyond[i],
            trajectory.poses[i],
            {pair: float(depth) for pair, depth in depths if depth > 0},
            trajectory.labels[trajectory.label[i]],
        )
