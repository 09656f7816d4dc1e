"""How the fields of suites are drawn: a module for each recipe, and where numbers come from."""
