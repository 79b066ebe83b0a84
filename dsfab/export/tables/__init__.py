"""Tables and records: lines, members and forces as CSV, JSON and workbooks."""
