"""``python -m groundcal``: the program, with all of its commands.

Example:
    $ python -m groundcal calibrate photos/ --out result/
"""

from __future__ import annotations

import sys

from . import _groundcal


def main() -> int:
    """Runs the program with the command line; its exit code."""
    return _groundcal.run_program(["groundcal", *sys.argv[1:]])


if __name__ == "__main__":
    sys.exit(main())
