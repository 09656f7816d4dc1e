"""Terminals, interrupts, processes, files and provenance: what agents and commands build on."""
