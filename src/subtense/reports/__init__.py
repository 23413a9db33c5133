"""Ways to show a Document, one per file. The table is `subtense.workflow.REPORTS`."""
