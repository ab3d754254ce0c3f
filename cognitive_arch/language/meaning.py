"""What one clause means by itself: the action behind its verb, and which of its parts that can use."""

from __future__ import annotations

from collections.abc import Sequence

from cognitive_arch.errors import InstructionError
from cognitive_arch.language.clauses import Clause

# What a command can do something with; anything else said beside it is refused, not overheard.
_PARTS = {
    "GRASP": {"onto"},
    "PUT": {"onto", "between"},
    "COVER": {"onto", "using", "recipe"},
    "DROP": {"onto"},
    "PULL": {"using"},
    "PUSH": {"using"},
}


def with_lists_joined(clauses: Sequence[Clause]) -> list[Clause]:
    """ "put the ham, then the cheese on the bun" is one list although "then" cuts it."""
    joined: list[Clause] = []
    for clause in clauses:
        before = joined[-1] if joined else None
        if (
            before is not None
            and not clause.verb
            and clause.things
            and not clause.recipe
            and not clause.using
        ):
            bare = before.things and not (before.onto or before.marks or before.hand or before.using)
            begins = before.verb == "PUT" or (not before.verb and len(joined) == 1)
            if bare and begins and not before.recipe:
                clause.verb, clause.verb_text = before.verb, before.verb_text
                clause.subject, clause.direct = before.things + clause.things, []
                clause.joint = before.joint
                joined[-1] = clause
                continue
        joined.append(clause)
    return joined


def action_of(verb: str, clause: Clause) -> str:
    """The action a verb stands for, seen together with the small words beside it."""
    marks = clause.marks
    placed = clause.onto or clause.between or "ATOP" in marks
    if verb in ("PUSH", "PULL") and ("CLOSER" if verb == "PUSH" else "AWAY") in marks:
        raise InstructionError("I pull things closer and push them away, not the other way round")
    if verb in ("GET", "MOVE", "GIVE", "GRASP", "PUT"):
        if placed and verb != "GRASP":
            return "PUT"
        if "CLOSER" in marks or (verb in ("GET", "GIVE") and clause.using):
            return "PULL"
        if "AWAY" in marks and verb == "PUT":
            return "DROP"
        if "AWAY" in marks and verb not in ("GET", "GIVE", "GRASP"):
            return "PUSH"
        if "UP" in marks or verb in ("GET", "GIVE"):
            return "GRASP"
        if verb == "MOVE":
            raise InstructionError(
                f"I do not know where to '{clause.verb_text}' it: closer, away or onto what"
            )
        if verb == "PUT" and clause.using:
            return "COVER"  # "layer the bun with ham"
        if verb == "PUT" and "ON_HAND" in marks:
            return "GRASP"
        if verb == "PUT" and "DOWN" in marks:
            return "DROP"
    if verb == "DROP" and placed and clause.things:
        return "PUT"
    return {"HOLD": "GRASP", "OPEN": "DROP"}.get(verb, verb)


def check_parts(action: str, clause: Clause) -> None:
    """Refuse a clause that says more than its action can use; drop mentions of the table it lies on."""
    tables = [m for m in clause.onto if m.kind == "TABLE"]
    if len(clause.onto) > len(tables):
        clause.onto = [m for m in clause.onto if m not in tables]  # "on the bun on the table"
    elif tables and action in ("PULL", "PUSH", "GRASP"):
        clause.onto = []  # "pull the ham on the table" says where it is
    said = clause.verb_text or action.lower()
    for part in sorted({"onto", "between", "using", "recipe"} - _PARTS.get(action, set())):
        value = getattr(clause, part)
        if value:
            name = value if isinstance(value, str) else value[0].text
            raise InstructionError(f"I do not know how '{name}' goes with '{said}'")
    if len(clause.onto) > 1 or (len(clause.using) > 1 and action != "COVER"):
        raise InstructionError(f"I do not know which of the places or tools '{said}' is for")
    if clause.without and (action not in ("GRASP", "DROP", "PUT") or not clause.things):
        raise InstructionError(f"I do not know how to '{said}' without '{clause.without[0].text}'")
