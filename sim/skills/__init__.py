"""The skills by the names the rules use: one module each, one row here."""

from __future__ import annotations

from dataclasses import dataclass

from sim.skills.base import Skill
from sim.skills.drop import drop
from sim.skills.grasp import grasp
from sim.skills.pull import pull
from sim.skills.push import push
from sim.skills.put import put_on


@dataclass(frozen=True)
class SkillEntry:
    """A skill and how many objects it takes before the hand."""

    perform: Skill
    n_objects: int


SKILLS = {
    "graspWith": SkillEntry(grasp, 1),
    "putOnWith": SkillEntry(put_on, 2),
    "dropWith": SkillEntry(drop, 1),
    "pull": SkillEntry(pull, 2),
    "push": SkillEntry(push, 2),
}
