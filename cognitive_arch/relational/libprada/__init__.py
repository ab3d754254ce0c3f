"""Planning problems in libPRADA's file formats: symbols, rules, initial state and goal."""

from cognitive_arch.relational.libprada.model import Symbol, SymbolKind
from cognitive_arch.relational.libprada.problem import LibPradaProblem, load_problem
from cognitive_arch.relational.libprada.writing import write_problem

__all__ = ["LibPradaProblem", "Symbol", "SymbolKind", "load_problem", "write_problem"]
