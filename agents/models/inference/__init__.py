"""Networks that fly without torch."""
