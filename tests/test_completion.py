"""Shell completion, as a bash asks for it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

SCRIPT = """\
eval "$(_SYNCLINE_DESIGN_COMPLETE=source_bash syncline-design)"
COMP_WORDS=({words}) COMP_CWORD={last}
_syncline_design_completion syncline-design
printf '%s\\n' "${{COMPREPLY[@]}}"
"""


@pytest.mark.skipif(shutil.which("bash") is None, reason="no bash on this machine")
@pytest.mark.parametrize(("words", "wanted"), [("ch", {"check"}), ("schema aud", {"audit"})])
def test_bash_completes(tmp_path: Path, words: str, wanted: set[str]) -> None:
    command = tmp_path / "syncline-design"
    command.write_text(f'#!/bin/sh\nexec {sys.executable} -P -m syncline_design "$@"\n', "utf-8")
    command.chmod(0o755)
    given = ["syncline-design", *words.split()]
    script = SCRIPT.format(words=" ".join(given), last=len(given) - 1)
    path = {**os.environ, "PATH": f"{tmp_path}{os.pathsep}{os.environ['PATH']}"}
    done = subprocess.run(["bash", "-c", script], env=path, capture_output=True, text=True,
                          timeout=120, check=True)  # fmt: skip
    assert set(done.stdout.split()) == wanted
    assert done.stderr == ""
