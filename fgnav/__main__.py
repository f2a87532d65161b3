"""``python -m fgnav``: the command line."""

from fgnav.cli import main

raise SystemExit(main())
