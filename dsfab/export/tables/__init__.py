"""Tables and records as CSV, JSON and workbooks."""
