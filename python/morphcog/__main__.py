"""python -m morphcog: the command."""

from ._command import main

main()
