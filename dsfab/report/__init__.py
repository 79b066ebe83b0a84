"""Reports: pages, charts and folders of results, for the user and the engineer."""
