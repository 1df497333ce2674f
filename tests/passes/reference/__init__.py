"""What the passes should compute, in float64 from the equations, and how their data lie in memory."""
