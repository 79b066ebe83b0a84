"""OCCT programs that read and check STEP files."""
