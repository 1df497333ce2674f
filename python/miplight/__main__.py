"""``python -m miplight`` is the command `miplight`."""

from .cli import main

main(prog_name="miplight")
