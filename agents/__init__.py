"""Agents: policies that fly the environment, their evaluation, and the command line."""
