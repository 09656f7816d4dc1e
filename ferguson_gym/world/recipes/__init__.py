"""How the fields of the suites `town` and `walls` are drawn, a module for each."""
