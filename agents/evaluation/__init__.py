"""Evaluation of policies on the same fields: flights, statistics, tables and files."""
