"""Ways to get Observations from a Photo, one per file. The table is `subtense.workflow.DETECTORS`."""
