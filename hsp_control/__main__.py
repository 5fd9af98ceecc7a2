"""``python -m hsp_control`` is ``hsp``."""

import sys

from hsp_control.cli import main

if __name__ == "__main__":
    sys.exit(main())
