"""The program `ferguson`: `main` is its entry point, each command a module of the same name.

A command's module declares its arguments and checks them; the work is done by the other folders
of `agents`, which are imported only when the command runs.
"""
