"""OCCT programs that read and check STEP files in processes of their own, and the readers of their reports."""
