"""The program `ferguson`: one file for each command."""
