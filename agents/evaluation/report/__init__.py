"""The report of an evaluation: one HTML page with tables, profiles and a browser of flights."""
