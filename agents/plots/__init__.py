"""Pictures of flights and comparisons."""
