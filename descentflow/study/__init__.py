"""The paper's whole study, type by type, from rows to tables and a report."""
