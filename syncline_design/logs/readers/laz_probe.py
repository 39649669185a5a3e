"""How far a packed cloud unpacks, tried in a process of its own: damaged points may end one.

lazrs 0.8.2 reads outside its memory where the layers of a chunk are damaged; a segmentation fault
cannot be caught, so it must not happen here.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

from syncline_design.machine.deadline import in_force
from syncline_design.machine.processes import python_command

CRASH: Final = "the library that unpacks its points crashes there"
_TOLD: Final = (
    "from pathlib import Path; from syncline_design.logs.readers.las import tell; "
    "tell(Path(sys.argv[1]))"
)


def sound_points(path: Path, claimed: int) -> int:
    """As many points of the claimed ones as unpack before the process that tries it dies."""
    sound = 0
    command = [*python_command(_TOLD), str(path)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, stdin=subprocess.DEVNULL
    ) as tried:
        try:
            assert tried.stdout is not None
            for line in tried.stdout:  # the number of points after every piece
                in_force().check()
                sound = int(line)
            tried.wait()
        except BaseException:
            tried.kill()
            raise
    return sound if tried.returncode < 0 and sound < claimed else claimed
