"""`python -m caldrive` is the same as `caldrive`."""

from __future__ import annotations

import sys

from caldrive.cli import main

if __name__ == "__main__":
    sys.exit(main())
