"""Programs that read and check STEP files with the CAD kernel OCCT."""
