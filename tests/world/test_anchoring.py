from __future__ import annotations

import json

from cognitive_arch.world.anchoring import WorldModel
from cognitive_arch.world.observation import HandObservation, ObjectObservation, Observation
from cognitive_arch.world.state import WorldState, sorted_atoms


def look(*objects: ObjectObservation, left: str | None = None, absent: tuple[str, ...] = ()) -> Observation:
    hands = (HandObservation("LeftHand", left), HandObservation("RightHand", None))
    return Observation(0.0, tuple(objects), hands, absent)


def thing(
    name: str, below: tuple[str, ...] = (), reach: tuple[str, ...] = ("LeftHand",)
) -> ObjectObservation:
    return ObjectObservation(name, "object", (-0.3, 0.0, 0.0), below, reach)


def test_ids_last_and_entities_are_ordered() -> None:
    world = WorldModel()
    first = world.update(look(thing("Ham"), thing("Bun")))
    assert [(h.id, h.name) for h in first.hands] == [(11, "LeftHand"), (12, "RightHand")]
    assert [(o.id, o.name) for o in first.objects] == [(13, "Ham"), (14, "Bun")]
    second = world.update(look(thing("Apple"), thing("Bun"), thing("Ham")))
    assert [(o.id, o.name) for o in second.objects] == [(13, "Ham"), (14, "Bun"), (15, "Apple")]
    assert (first.version, second.version) == (0, 1)


def test_on_is_transitive_downward() -> None:
    seen = look(thing("A", ("B",)), thing("B", ("C",)), thing("C"))
    atoms = sorted_atoms(WorldModel().update(seen).atoms())
    assert [a for a in atoms if a.startswith("on")] == ["on(A,B)", "on(A,C)", "on(B,C)"]


def test_what_is_out_of_sight_is_remembered() -> None:
    world = WorldModel()
    world.update(look(thing("Ham", ("Bun",)), thing("Bun")))
    state = world.update(look(thing("Ham", ("Bun",))))
    bun = state.object("Bun")
    assert bun is not None
    assert not bun.visible
    assert "on(Ham,Bun)" in sorted_atoms(state.atoms())


def test_an_empty_place_means_it_is_gone() -> None:
    world = WorldModel()
    world.update(look(thing("Ham"), thing("Bun")))
    state = world.update(look(thing("Ham"), absent=("Bun",)))
    assert state.object("Bun") is None
    assert not any("Bun" in atom for atom in sorted_atoms(state.atoms()))


def test_a_new_instruction_keeps_what_is_held() -> None:
    world = WorldModel()
    world.update(look(thing("Ham"), thing("Bun"), left="Ham"))
    world.update(look(left="Ham"))  # neither is in view now; the ham is in the hand
    world.begin_instruction()
    state = world.update(look(left="Ham"))
    assert [o.name for o in state.objects] == ["Ham"]
    assert state.held == {"Ham": "LeftHand"}
    assert "inHand(Ham,LeftHand)" in sorted_atoms(state.atoms())
    assert "isClear(LeftHand)" not in sorted_atoms(state.atoms())


def test_a_held_thing_is_reachable_with_its_hand_only() -> None:
    # Otherwise putOnWith(Bun,Ham,RightHand) would apply while the ham is in the left hand.
    state = WorldModel().update(look(thing("Ham", reach=("LeftHand", "RightHand")), thing("Bun"), left="Ham"))
    ham = [a for a in sorted_atoms(state.atoms()) if a.startswith("reachableWith(Ham")]
    assert ham == ["reachableWith(Ham,LeftHand)"]


def test_unheld_after_being_held_out_of_sight() -> None:
    world = WorldModel()
    world.update(look(thing("Ham"), left="Ham"))
    state = world.update(look())
    assert state.held == {}
    assert state.object("Ham") is not None


def test_json_round_trip() -> None:
    state = WorldModel().update(look(thing("Ham", ("Bun",)), thing("Bun"), left=None))
    assert WorldState.from_json(json.loads(json.dumps(state.to_json()))) == state
