"""Ways to get a Camera, one per file. The table, in order of trust, is `subtense.workflow.CAMERA_SOURCES`.

Each way is a function from what is known to a `Hypothesis`: a camera with its u, or the reason why there is none.
"""
