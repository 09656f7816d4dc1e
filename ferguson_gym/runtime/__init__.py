"""Arrays, compilation, threads, files and suggestions: what every room of the package builds on."""
