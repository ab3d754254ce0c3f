"""The wheel, installed into an empty environment outside the checkout, runs."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import venv
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.physics
def test_the_wheel_runs_on_its_own(tmp_path: Path) -> None:
    def run(*command: str | Path, **extra: str) -> str:
        env = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "COGARCH", "VIRTUAL"))}
        done = subprocess.run(
            [str(c) for c in command],
            cwd=tmp_path,
            env=env | extra,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--wheel-dir", tmp_path, ROOT)
    (wheel,) = tmp_path.glob("*.whl")
    venv.create(tmp_path / "env", with_pip=True)
    python = tmp_path / "env" / "bin" / "python"
    run(python, "-m", "pip", "install", "--quiet", "-c", ROOT / "constraints.txt", wheel)
    where = run(python, "-c", "import cognitive_arch, sim; print(cognitive_arch.__file__, sim.__file__)")
    assert str(ROOT) not in where
    cogarch = tmp_path / "env" / "bin" / "cogarch"
    result = json.loads(run(cogarch, "run", "make a ham sandwich", "--backend", "symbolic", "--json"))
    assert result["success"]
    result = json.loads(run(cogarch, "run", "pick up the ham", "--no-record", "--json"))
    assert result["success"]
    assert "grasp" in run(cogarch, "parse", "grasp the cheese", "--scene", "kitchen")
