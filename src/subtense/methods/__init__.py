"""Ways to get a Measurement, one per file. The table is `subtense.workflow.METHODS`."""
