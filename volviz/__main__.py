"""`python -m volviz`."""

from volviz.cli import main

main()
