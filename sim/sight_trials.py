"""How well the robot sees: what it believes of random scenes beside what is there, for tests and benchmarks.

A scene is looked at as it lies, then again with some of its things piled up, then with a thing in a hand.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from pydrake.math import RigidTransform, RollPitchYaw

from cognitive_arch.domain import load_domain
from cognitive_arch.relational.symbols import GroundAction, State
from cognitive_arch.scenes import load_scene
from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import HANDS, Observation
from sim.environment import DrakeEnvironment
from sim.eyes import IDEAL, EyeNoise

DOMAINS = ("sandwich", "toys")
PILE = 3  # things on top of each other at most
ASKEW = 0.006  # m by which a pile's layers may be off its middle
GAP = 0.0003  # m
SETTLE = 0.4  # s


@dataclass(frozen=True)
class Look:
    """One look: how far off each thing on the table was believed to be (m), the atoms that are believed
    though not true, those overlooked, of each predicate how many are true or believed at all, and how
    many things were seen that are none of those that are there."""

    moment: str
    errors: dict[str, float]
    wrong: tuple[str, ...]
    overlooked: tuple[str, ...]
    counts: Mapping[str, int]
    strangers: int

    @property
    def atoms(self) -> int:
        """How many are true or believed."""
        return sum(self.counts.values())

    def mistaken(self, predicate: str) -> int:
        """How many atoms of a predicate are wrong or overlooked."""
        return sum(atom.startswith(f"{predicate}(") for atom in (*self.wrong, *self.overlooked))


def scene_name(seed: int) -> str:
    """Alternately of either domain."""
    return f"random:{seed}:{DOMAINS[seed % len(DOMAINS)]}"


def looks(seed: int, eye_noise: EyeNoise = IDEAL, shadows: bool = False) -> Iterator[Look]:
    """Three looks at the random scene of a seed."""
    scene = load_scene(scene_name(seed))
    environment = DrakeEnvironment(load_domain(scene.domain), scene, eye_noise=eye_noise, shadows=shadows)
    rng = np.random.default_rng(seed)
    model = WorldModel()
    try:
        model.update(environment.reset(seed))
        yield _compared("lying", environment, model)
        _pile(environment, rng)
        model.update(environment.observe())
        yield _compared("piled", environment, model)
        if _take_something(environment, rng):
            model.update(environment.observe())
            yield _compared("in hand", environment, model)
    finally:
        environment.close()


def _compared(moment: str, environment: DrakeEnvironment, model: WorldModel) -> Look:
    truth = environment.robot.truth
    believed, true = model.state.atoms(), _atoms(truth.observe())
    held = {truth.held(hand) for hand in HANDS}
    errors = {}
    for obj in model.state.objects:
        if obj.visible and obj.name not in held and obj.name in truth.names():
            errors[obj.name] = math.dist(obj.position[:2], truth.pose(obj.name).translation()[:2])
    return Look(
        moment,
        errors,
        tuple(sorted(map(str, believed - true))),
        tuple(sorted(map(str, true - believed))),
        Counter(atom.predicate for atom in believed | true),
        len(environment.robot.perception.strangers()),
    )


def _atoms(observation: Observation) -> State:
    return WorldModel().update(observation).atoms()


def _pile(environment: DrakeEnvironment, rng: np.random.Generator) -> None:
    """Somebody puts some things on top of each other: flat ones, the wider below."""
    world = environment.world
    shapes = {name: spec.shape for name, spec in world.domain.objects.items()}
    flat = sorted(
        name
        for name in environment.robot.truth.names()
        if not shapes[name].rolls and shapes[name].type != "tool"
    )
    chosen = [str(name) for name in rng.permutation(flat)[: int(rng.integers(2, PILE + 1))]]
    chosen.sort(key=lambda name: -min(shapes[name].extent))
    x, y, _ = world.pose(chosen[0]).translation()
    z = world.scene.table.height
    for name in chosen:
        height = world.height(name)
        off = rng.uniform(-ASKEW, ASKEW, 2)
        turn = RollPitchYaw(0.0, 0.0, float(rng.uniform(-math.pi, math.pi)))
        world.place(name, RigidTransform(turn, [x + off[0], y + off[1], z + height / 2 + GAP]))
        z += height + GAP
    environment.settle(SETTLE)


def _take_something(environment: DrakeEnvironment, rng: np.random.Generator) -> bool:
    """The robot takes one of the things that it can take; whether it has one then."""
    robot = environment.robot
    pairs = [
        (name, hand) for name in robot.truth.names() for hand in HANDS if robot.truth.can_take(hand, name)
    ]
    for n in rng.permutation(len(pairs))[:3]:
        name, hand = pairs[n]
        environment.execute(GroundAction("graspWith", (name, hand)))
        if robot.truth.held(hand) is not None:
            return True
    return False
