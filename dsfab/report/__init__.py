"""Reports for the user and the engineer."""
