"""What the robot must not run into: itself, the table and the things on it, with what it holds.

Drake's collision checker looks at the same primitives as the simulation, with a margin.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import BodyIndex
from pydrake.planning import RobotDiagramBuilder, SceneGraphCollisionChecker

from cognitive_arch.perception.strangers import Stranger
from cognitive_arch.world.observation import HANDS
from sim.assets import TRUNK
from sim.hands import SIDES, hand_links
from sim.scenario import TIME_STEP, drake_shape, populate, solid_parts
from sim.world import PARK, Joints, World

MARGIN = 0.006  # m that the robot keeps from what it does not mean to touch
HAND_MARGIN = 0.0015  # m that hands, and what they hold, keep: they work between things that lie close
STRANGERS = "strangers"  # what the checker calls the shapes of things that are not known
STEP = 0.08  # rad of the fastest joint between two configurations that are looked at

Pair = tuple[BodyIndex, BodyIndex]


class Clearance:
    """Answers for a world as it was at the last `look`; joint vectors are those of the world."""

    def __init__(self, world: World) -> None:
        self._world = world
        builder = RobotDiagramBuilder(time_step=TIME_STEP)
        self._robot, table, self._objects = populate(builder.plant(), world.domain, world.scene)
        builder.plant().Finalize()
        self._checker = SceneGraphCollisionChecker(
            model=builder.Build(),
            robot_model_instances=[self._robot],
            edge_step_size=STEP,
            env_collision_padding=MARGIN,
            self_collision_padding=MARGIN,
        )
        self._plant = self._checker.plant()
        self._base = world.configuration(world.home)
        self._watch_arms()
        # Tools sweep over the table, and finger tips come down to it.
        for link in itertools.chain.from_iterable(map(self._links, HANDS)):
            self._checker.SetPaddingOneRobotBodyAllEnvironmentPairs(link, HAND_MARGIN)
            self._checker.SetPaddingBetween(link, table.index(), 0.0)

    def _links(self, hand: str, *more: str) -> list[BodyIndex]:
        """The links of a hand, and those of its arm named in `more`."""
        names = hand_links(SIDES[hand]) | {f"{SIDES[hand]}_{link}" for link in more}
        bodies = (self._plant.get_body(index) for index in self._plant.GetBodyIndices(self._robot))
        return [body.index() for body in bodies if body.name() in names]

    def _watch_arms(self) -> None:
        """Of the robot's own links: the arms from each other, hands and forearms from trunk and head."""
        own = self._plant.GetBodyIndices(self._robot)
        trunk = [self._plant.GetBodyByName(name).index() for name in (*TRUNK, "head")]
        left, right = (self._links(hand, "forearm", "upper_arm") for hand in HANDS)
        watched = {*itertools.product(left, right)}
        for hand in HANDS:
            watched |= {*itertools.product(self._links(hand, "forearm"), trunk)}
        self._filter(itertools.combinations(own, 2), True)
        self._filter(watched, False)

    def _filter(self, pairs: Iterable[Pair], ignored: bool) -> list[Pair]:
        """Ignore pairs of bodies, or look at them again; returns those for which that was a change."""
        # All at once, for each change of the filters takes milliseconds.
        matrix = self._checker.GetFilteredCollisionMatrix().copy()
        changed = []
        for one, other in pairs:
            i, j = int(one), int(other)
            if matrix[i, j] == int(not ignored):
                matrix[i, j] = matrix[j, i] = int(ignored)
                changed.append((one, other))
        self._checker.SetCollisionFilterMatrix(matrix)
        return changed

    def look(
        self,
        poses: Mapping[str, RigidTransform],
        held: Mapping[str, tuple[str, RigidTransform]],
        strangers: Iterable[Stranger] = (),
    ) -> None:
        """Take in where everything is: `poses` (X_WO) and `strangers` are all that counts as there; `held`
        maps hands to what they hold and its pose in the hand frame."""
        world, checker = self._world, self._checker
        self._base = world.configuration(world.command)
        for name, body in self._objects.items():
            start, X_WO = body.floating_positions_start(), poses.get(name, RigidTransform(PARK))
            self._base[start : start + 4] = X_WO.rotation().ToQuaternion().wxyz()
            self._base[start + 4 : start + 7] = X_WO.translation()
        for hand in HANDS:
            checker.RemoveAllAddedCollisionShapes(hand)
        for hand, (name, X_HO) in held.items():
            palm = self._plant.GetBodyByName(f"{SIDES[hand]}_hand_dh_frame")
            for part in solid_parts(world.domain.objects[name].shape):
                checker.AddCollisionShapeToBody(hand, palm, drake_shape(part.solid), X_HO @ part.X_OP)
            # The thing itself has become part of the hand.
            start = self._objects[name].floating_positions_start()
            self._base[start + 4 : start + 7] = PARK
        checker.RemoveAllAddedCollisionShapes(STRANGERS)
        world_body = self._plant.world_body()
        for stranger in strangers:
            box, X_WS = drake_shape(stranger.shape), RigidTransform(stranger.pose)
            checker.AddCollisionShapeToBody(STRANGERS, world_body, box, X_WS)

    def _at(self, joints: Joints) -> Joints:
        return self._world.with_joints(self._base, joints)

    def free(self, joints: Joints) -> bool:
        """Whether nothing is too near."""
        return bool(self._checker.CheckConfigCollisionFree(self._at(joints)))

    def free_path(self, waypoints: Sequence[Joints]) -> bool:
        """Whether nothing is too near at the waypoints (at least one) and between them."""
        return all(self.free(joints) for joints in _fine(waypoints))

    def free_from(self, here: Joints, waypoints: Sequence[Joints]) -> bool:
        """As `free_path` from `here`, but what is too near there may stay so until the way is free of it."""
        places, near, away = list(_fine([here, *waypoints])), self._near(here), 0
        if near:
            away = next((i for i, joints in enumerate(places) if self.free(joints)), len(places))
            with self._allowing(near):
                if not all(map(self.free, places[:away])):
                    return False
        return all(map(self.free, places[away:]))

    def too_near(self, joints: Joints) -> tuple[tuple[str, str], ...]:
        """Pairs of bodies that are too near each other, sorted."""
        names = (tuple(self._plant.get_body(index).name() for index in pair) for pair in self._near(joints))
        return tuple(sorted((min(pair), max(pair)) for pair in names))

    def _near(self, joints: Joints) -> set[Pair]:
        found = self._checker.CalcRobotClearance(self._at(joints), 0.0)
        rows = zip(found.robot_indices(), found.other_indices(), found.distances(), strict=True)
        return {(one, other) for one, other, distance in rows if distance <= 0}

    @contextmanager
    def touching(self, hand: str, names: Iterable[str]) -> Iterator[None]:
        """Meanwhile the hand, or what it holds, may touch these objects."""
        objects = [self._objects[name].index() for name in names]
        with self._allowing(set(itertools.product(self._links(hand), objects))):
            yield

    @contextmanager
    def _allowing(self, pairs: set[Pair]) -> Iterator[None]:
        changed = self._filter(pairs, True)
        try:
            yield
        finally:
            self._filter(changed, False)


def _fine(waypoints: Sequence[Joints]) -> Iterator[Joints]:
    """The waypoints and places between them, at most `STEP` apart."""
    yield waypoints[0]
    for start, end in itertools.pairwise(waypoints):
        n = max(1, math.ceil(float(np.abs(end - start).max()) / STEP))
        for i in range(1, n + 1):
            yield start + (end - start) * i / n
