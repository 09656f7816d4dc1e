"""A flight as a GIF: `frames` decides what each frame shows, `animation` draws, `gif` encodes."""
