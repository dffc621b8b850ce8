"""The script that makes the environments: it reads what pyproject.toml says, and everything there is pinned."""

import importlib.util
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
SCRIPT = ROOT / "tools" / "environment.py"

specification = importlib.util.spec_from_file_location("environment", SCRIPT)
environment = importlib.util.module_from_spec(specification)
specification.loader.exec_module(environment)

PYPROJECT = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
GROUPS = environment.dependency_groups(PYPROJECT)


def test_groups_are_read_as_toml_has_them():
    assert tomllib.loads(PYPROJECT)["dependency-groups"] == GROUPS


@pytest.mark.parametrize("blender", environment.PYTHON_OF)
def test_every_requirement_is_pinned(blender):
    wanted = environment.requirements(GROUPS, blender)
    assert wanted[0].startswith(f"bpy=={blender}.")
    assert all("==" in requirement for requirement in wanted)


def test_stamp_is_outdated_when_a_pin_changes(tmp_path):
    python = environment.python_in(tmp_path)
    python.parent.mkdir(parents=True)
    python.touch()
    wanted = environment.digest(environment.requirements(GROUPS, "5.2"))
    environment.write_stamp(tmp_path, {"blender": "5.2", "requirements": wanted, "libraries": True})
    stamp = environment.read_stamp(tmp_path)
    assert environment.is_current(stamp, "5.2", GROUPS, tmp_path)
    changed = {**GROUPS, "development": [*GROUPS["development"], "another==1.0"]}
    assert not environment.is_current(stamp, "5.2", changed, tmp_path)
    assert not environment.is_current(stamp, "4.5", GROUPS, tmp_path)


def test_half_written_stamp_counts_as_none(tmp_path):
    (tmp_path / environment.STAMP).write_text('{"blender": "5.')
    assert environment.read_stamp(tmp_path) is None


def test_newest_patch_version_comes_first():
    paths = [Path(f"/versions/3.13.{patch}/bin/python") for patch in (2, 11, 0)]
    assert environment.newest_first(paths)[0] == paths[1]


def test_unrunnable_python_is_passed_over(tmp_path, monkeypatch):
    shim = tmp_path / "python3.13"
    shim.write_text("#!/bin/sh\nexit 127\n")
    shim.chmod(0o755)
    monkeypatch.setattr(environment, "python_candidates", lambda version: [shim])
    assert environment.find_python("3.13") == (None, None)


def test_missing_libraries_are_named_with_their_packages(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(environment.sys, "platform", "linux")
    monkeypatch.setattr(environment, "missing_libraries", lambda folder: {"libXi.so.6", "libSM.so.6"})
    with pytest.raises(SystemExit):
        environment.check_libraries(tmp_path)
    assert "apt-get install libsm6 libxi6" in capsys.readouterr().err


def test_unknown_blender_ends_with_one_sentence():
    done = subprocess.run([sys.executable, SCRIPT, "--blender", "2.79"], check=False, capture_output=True, text=True)
    assert done.returncode == 1
    assert done.stderr == "There is no environment for Blender 2.79: BLENDER is one of 5.3, 5.2, 5.0, 4.5.\n"
