"""The report of an evaluation, one page that opens without a network."""
