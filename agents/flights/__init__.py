"""Flying policies through fields, one by one or in batches, and what is measured of a flight."""
