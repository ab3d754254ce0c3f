from __future__ import annotations

import os
from pathlib import Path

import pytest

from cognitive_arch.affordances.trials import TrialTable
from tests.affordances.synthetic import synthetic_trials

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = Path(os.environ.get("COGARCH_DATA", ROOT.parent / "shared/data")) / "affordances"


@pytest.fixture(scope="session")
def trials() -> TrialTable:
    return synthetic_trials()


@pytest.fixture(scope="session")
def published() -> Path:
    if not (PUBLISHED / "hand_trials.csv").is_file():
        pytest.skip("the published trials are not here")
    return PUBLISHED
